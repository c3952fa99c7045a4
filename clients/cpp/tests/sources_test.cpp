// Sketches and maps from what people and robots have at hand.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <limits>
#include <sketchmatch/raw.hpp>
#include <sketchmatch/sketchmatch.hpp>
#include <string>
#include <vector>

#include "fake_server.hpp"

namespace sketchmatch::test {

namespace {

namespace fs = std::filesystem;

template <typename Make>
std::string refusal(const Make& make) {
  try {
    static_cast<void>(make());
  } catch (const InvalidRequestError& error) {
    return error.reason() + ": " + error.what();
  }
  return "taken";
}

class MapFiles : public testing::Test {
 protected:
  void SetUp() override {
    fs::remove_all(folder);
    fs::create_directories(folder);
  }

  [[nodiscard]] fs::path write(const std::string& name, const std::string& text) const {
    std::ofstream(folder / name, std::ios::binary) << text;
    return folder / name;
  }

  [[nodiscard]] std::string refused(const fs::path& path) const {
    const auto text = refusal([&] { return sources::map_server_map(path); });
    const auto at = text.find(folder.string());
    return at == std::string::npos ? text : std::string(text).erase(at, folder.string().size());
  }

  fs::path folder = fs::path(testing::TempDir()) / "sketchmatch_maps";
};

}  // namespace

TEST(Sources, LabelsAreAsManyAsThings) {
  const std::vector<Ring> rooms{{{0, 0}, {1, 0}, {1, 1}}, {{5, 5}, {6, 5}, {6, 6}}};
  EXPECT_EQ(refusal([&] { return sources::polygons(rooms, {"bed"}); }),
            "INVALID_FIELD: labels has 1 names for 2 polygons; give one for each, or none");
  EXPECT_EQ(refusal([&] {
              return sources::strokes({{{1, 2}}}, {"a", "b"});
            }),
            "INVALID_FIELD: labels has 2 names for 1 strokes; give one for each, or none");
  EXPECT_EQ(refusal([&] { return sources::polygons(rooms, {}, YAxis::up, {0.5}); }),
            "INVALID_FIELD: certainties has 1 numbers for 2 polygons; give one for each, or none");
}

TEST(Sources, TextThatIsNoUtf8IsRefused) {
  const std::vector<Ring> room{{{0, 0}, {1, 0}, {1, 1}}};
  for (const char* wrong : {"\xC4ster", "\xED\xA0\x80", "\xC0\x80", "\xF5\x80\x80\x80", "\xE2\x82",
                            "\xF0\x8F\xBF\xBF"}) {
    EXPECT_EQ(refusal([&] {
                return sources::polygons(room, {wrong});
              }).rfind("INVALID_FIELD: labels[0] is '", 0),
              0U)
        << wrong;
  }
  EXPECT_EQ(refusal([&] { return sources::polygons(room, {"Ä €𝄞 \xF4\x8F\xBF\xBF"}); }), "taken");
}

TEST(Sources, AGridIsARectangle) {
  EXPECT_EQ(refusal([] {
              return sources::occupancy_grid({0, 0, 0}, 2, 0.05);
            }),
            "INVALID_GRID: occupancy_grid.columns is 2 for 3 cells; give the number of cells in a "
            "row");
  EXPECT_NE(refusal([] { return sources::occupancy_grid({0, 0, 0}, 0, 0.05); }), "taken");
  EXPECT_NE(refusal([] { return sources::occupancy_grid({}, 2, 0.05); }), "taken");
  const auto grid = sources::occupancy_grid({0, 100, -1, 0, 0, 0}, 3, 0.05).message();
  EXPECT_EQ(grid.occupancy_grid().rows(), 2U);
  EXPECT_EQ(grid.occupancy_grid().cells(), std::string("\0\x64\xFF\0\0\0", 6));
}

TEST(Sources, FilesAreSentAsTheyAre) {
  EXPECT_EQ(refusal([] { return sources::file("/nowhere/plan.dxf"); }),
            "INVALID_FILE: file (/nowhere/plan.dxf) cannot be read: No such file or directory; "
            "check the path");
  EXPECT_NE(refusal([] { return sources::image(testing::TempDir()); }), "taken");
  EXPECT_EQ(refusal([] { return sources::file_of("x", ""); }),
            "INVALID_FILE: file.name is empty; give bytes a name whose ending tells what they are");
  const auto path = fs::path(testing::TempDir()) / "strokes.json";
  std::ofstream(path, std::ios::binary) << std::string("a\0\r\n\xFF", 5);
  const auto sent = sources::file(path, "cellar").message().file();
  EXPECT_EQ(sent.name(), "strokes.json");
  EXPECT_EQ(sent.data(), std::string("a\0\r\n\xFF", 5));
  EXPECT_EQ(sent.part(), "cellar");
  EXPECT_EQ(sources::file(path, "", "room.svg").message().file().name(), "room.svg");
}

TEST(Options, WhatHasNoPlaceInARequestIsRefused) {
  const Client client("localhost:1");
  const auto room = sources::polygons({{{0, 0}, {1, 0}, {1, 1}}});
  const auto refused = [&](const MatchOptions& options) {
    return refusal([&] { return client.events(room, room, options); });
  };
  MatchOptions options;
  options.params["seacher"]["population"] = 9;
  EXPECT_EQ(refused(options),
            "INVALID_FIELD: params has no stage 'seacher'; the stages are sketch_segmenter, "
            "map_segmenter, histogram, similarity, searcher, judge");
  options = {};
  options.time_budget = Seconds(std::numeric_limits<double>::infinity());
  EXPECT_EQ(refused(options),
            "INVALID_FIELD: time_budget is inf; give a positive time in seconds, or none at all");
  options = {};
  options.pins = {Pin{0, 1}, Pin{-1, 2}};
  EXPECT_EQ(refused(options),
            "INVALID_FIELD: pins[1].sketch_object is -1; give the index of an object, from 0");
  options = {};
  options.searcher = "\xFF";
  EXPECT_NE(refused(options), "taken");
}

TEST(Options, ATimeBudgetIsExactToTheNanosecond) {
  FakeServer server;
  const Client client(server.address());
  const auto room = sources::polygons({{{0, 0}, {1, 0}, {1, 1}}});
  MatchOptions options;
  options.time_budget = Seconds(0.9999999999);
  static_cast<void>(client.match(room, room, options));
  EXPECT_NE(server.requests().back().find("time_budget {\n  seconds: 1\n}"), std::string::npos);
  options.time_budget = Seconds(2.1);
  static_cast<void>(client.match(room, room, options));
  EXPECT_NE(server.requests().back().find("  seconds: 2\n  nanos: 100000000\n"), std::string::npos);
}

TEST_F(MapFiles, APictureIsTakenFromWhereTheYamlSaysOrBesideIt) {
  static_cast<void>(write("room.pgm", "picture"));
  const auto here = write("room.yaml", "image: room.pgm\nresolution: 0.05\n");
  const auto source = sources::map_server_map(here);
  EXPECT_EQ(source.message().map_server_map().image(), "picture");
  EXPECT_TRUE(source.notes().empty());
  for (const char* elsewhere : {"/home/robot/maps/room.pgm", "'C:\\maps\\room.pgm'"}) {
    const auto moved = write("moved.yaml", std::string("image: ") + elsewhere + "\n");
    const auto found = sources::map_server_map(moved);
    EXPECT_EQ(found.message().map_server_map().image(), "picture");
    ASSERT_EQ(found.notes().size(), 1U);
    EXPECT_NE(found.notes()[0].find("room.pgm beside moved.yaml was used"), std::string::npos);
  }
}

TEST_F(MapFiles, AFileOfObjectsIsTakenIfItHasTheMapsNameAndIsText) {
  static_cast<void>(write("room.pgm", "picture"));
  const auto map = write("room.yaml", "image: room.pgm\nresolution: 0.05\n");
  static_cast<void>(write("other.objects.geojson", "{}"));
  static_cast<void>(write("room.objects.geojson", "\xFF"));
  EXPECT_EQ(sources::map_server_map(map).message().map_server_map().objects(), "");
  EXPECT_TRUE(sources::map_server_map(map).notes().empty());
  static_cast<void>(write("room.objects.geojson", "\xEF\xBB\xBF{}"));
  EXPECT_EQ(sources::map_server_map(map).message().map_server_map().objects(), "{}");
}

TEST_F(MapFiles, TheFirstOfTwoPicturesCounts) {
  static_cast<void>(write("a.pgm", "first"));
  static_cast<void>(write("b.pgm", "second"));
  const auto source =
      sources::map_server_map(write("room.yaml", "image: a.pgm\nresolution: 1\nimage: b.pgm\n"));
  EXPECT_EQ(source.message().map_server_map().image(), "first");
  ASSERT_EQ(source.notes().size(), 1U);
  EXPECT_EQ(source.notes()[0], "room.yaml has image twice, and the first, a.pgm, was used");
}

TEST_F(MapFiles, APictureOrAFolderLeadsToItsYaml) {
  const auto picture = write("room.pgm", "picture");
  static_cast<void>(write("notes.yaml", "a: b\n"));
  static_cast<void>(write("room.yaml", "\xEF\xBB\xBFimage: room.pgm\nresolution: 0.05\n"));
  for (const auto& path : {picture, folder}) {
    EXPECT_EQ(sources::map_server_map(path).message().map_server_map().yaml(),
              "image: room.pgm\nresolution: 0.05\n");
  }
  static_cast<void>(write("other.yaml", "image: room.pgm\nresolution: 0.1\n"));
  EXPECT_NE(sources::map_server_map(picture).message().map_server_map().yaml().find("0.05"),
            std::string::npos);
  EXPECT_EQ(refused(folder),
            "INVALID_FILE: map_server_map.yaml () is a folder with several maps; give one of them: "
            "other.yaml, room.yaml");
}

TEST_F(MapFiles, WhatIsNoMapIsRefusedInOneSentence) {
  EXPECT_EQ(refused(folder),
            "INVALID_FILE: map_server_map.yaml () is a folder without a map; give the .yaml that "
            "map_server saved");
  EXPECT_EQ(refused(folder / "none.yaml"),
            "INVALID_FILE: map_server_map.yaml (/none.yaml) cannot be read: No such file or "
            "directory; check the path");
  EXPECT_EQ(refused(write("alone.pgm", "x")),
            "INVALID_FILE: map_server_map.yaml (/alone.pgm) is a picture that no .yaml beside it "
            "names; give the map's .yaml");
  EXPECT_EQ(refused(write("a.yaml", "resolution: 1\n")),
            "INVALID_FILE: map_server_map.yaml (/a.yaml) names no picture; add a line `image: "
            "FILE`");
  EXPECT_EQ(refused(write("a.yaml", "image: ~\n")),
            "INVALID_FILE: map_server_map.yaml (/a.yaml) names no picture; add a line `image: "
            "FILE`");
  EXPECT_EQ(refused(write("a.yaml", "image: gone.pgm\n")),
            "INVALID_FILE: map_server_map.image (/gone.pgm, as " + folder.string() +
                "/a.yaml names it) cannot be read: No such file or directory; check the path");
  EXPECT_EQ(refused(write("a.yaml", "just text")),
            "INVALID_GRID: map_server_map.yaml (/a.yaml) is not a list of keys and values; give "
            "the file that map_server saved");
  EXPECT_EQ(refused(write("a.yaml", "image: [\n")),
            "INVALID_GRID: map_server_map.yaml (/a.yaml) is not YAML (line 2); give the file that "
            "map_server saved");
  EXPECT_EQ(refused(write("a.yaml", "image: \xFF\n")),
            "INVALID_FILE: map_server_map.yaml (/a.yaml) is not UTF-8 text; save it as UTF-8");
  EXPECT_EQ(refused(write("a.yaml", std::string(70'000, '#'))),
            "LIMIT_EXCEEDED: map_server_map.yaml (/a.yaml) has 70000 bytes, more than the limit of "
            "64 KiB for a map's YAML; give the file that map_server saved");
}

TEST_F(MapFiles, NestedWithoutEndIsRefusedAndNoCrash) {
  for (const std::string& text : {std::string(60'000, '['), std::string(60'000, '{')}) {
    EXPECT_EQ(refused(write("deep.yaml", "image: " + text)).rfind("INVALID_GRID: ", 0), 0U);
  }
  std::string dashes;
  for (int k = 0; k < 30'000; ++k) {
    dashes += "- ";
  }
  EXPECT_EQ(refused(write("deep.yaml", dashes)).rfind("INVALID_GRID: ", 0), 0U);
}

}  // namespace sketchmatch::test
