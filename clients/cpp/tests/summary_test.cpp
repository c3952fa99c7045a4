// What servers answer, in a line or a small table.
#include <gtest/gtest.h>

#include <sketchmatch/sketchmatch.hpp>
#include <sstream>

#include "fake_server.hpp"
#include "golden.hpp"

namespace sketchmatch::test {

namespace {

template <typename Answer>
std::string printed(const Answer& answer) {
  std::ostringstream out;
  out << answer;
  return out.str();
}

Source room() { return sources::polygons({{{0, 0}, {1, 0}, {1, 1}}}); }

}  // namespace

TEST(Summary, OfAMatchIsASmallTable) {
  FakeServer server;
  server.events = golden_match();
  std::string progress;
  const auto match = Client(server.address()).match(room(), room(), {}, [&](const Progress& seen) {
    progress = printed(seen);
  });
  EXPECT_EQ(printed(match),
            "3 of 3 sketched objects matched, FMAP confidence 0.910, OMAP confidence 0.820, "
            "probability 0.365, this place 0.905, 2 maps about as likely, ask what 0 bed is, "
            "ITERATION_LIMIT\n"
            "in the sketch   on the map                confidence  probability  margin\n"
            "1 desk          3 rack                         0.810        0.770   0.120\n"
            "2 shelf         0 table                        0.830        0.690  -0.020\n"
            "0 bed + 1 desk  3 rack                        as one        0.735\n"
            "2 shelf         0 table + 1 bar + 2 bunk      as one");
  EXPECT_EQ(progress, "SEARCH, 1.25 s, 62%, confidence 0.710, 1300 evaluations, at most 0.930");
}

TEST(Summary, OfObjectsThatAreOneTogetherSaysSo) {
  Match match;
  match.scenes.sketch.objects.resize(3);
  match.scenes.map.objects.resize(2);
  match.scenes.sketch.objects[2].label = "hall";
  match.scenes.map.objects[1].label = "foyer";
  match.result.object_matches.resize(1);
  match.result.object_matches[0].map_object = 1;
  match.result.unmatched_sketch_objects = {1, 2};
  match.result.unmatched_sketch_probabilities = {0.5, 0.75};
  match.result.object_groups = {{{0, 2}, {1}, 0.875}};
  EXPECT_EQ(printed(match),
            "2 of 3 sketched objects matched, FMAP confidence 0.000, OMAP confidence 0.000, "
            "UNSPECIFIED\n"
            "in the sketch  on the map  confidence  probability  margin\n"
            "0              1                0.000\n"
            "1              no partner                    0.500\n"
            "0 + 2 hall     1 foyer         as one        0.875");
}

TEST(Summary, OfAnotherPlaceSaysSo) {
  Match match;
  match.result.place_probability = 0.25;
  match.result.probability = 0.9997;
  match.result.outcome = static_cast<Outcome>(77);  // of a newer server
  EXPECT_EQ(printed(match),
            "probably not this place (this place: 0.250): 0 of 0 sketched objects matched, FMAP "
            "confidence 0.000, OMAP confidence 0.000, probability >0.999, 77\n"
            "in the sketch  on the map  confidence  probability  margin");
}

TEST(Summary, MovesNoCursorAndCutsLongLabels) {
  Segmentation found;
  found.segmenter.name = "strokes";
  found.scene.objects.resize(22);
  found.scene.objects[0].label = "a\x1B[2Jb";
  found.scene.objects[1].label = std::string(30, 'x') + "ü";
  found.warnings = {"one stroke is left out"};
  const auto text = printed(found);
  EXPECT_EQ(text.find('\x1B'), std::string::npos);
  EXPECT_NE(text.find("1 " + std::string(27, 'x') + "... "), std::string::npos);
  EXPECT_NE(text.find("\n... and 2 more\none stroke is left out"), std::string::npos);
  EXPECT_EQ(text.rfind("22 objects, by strokes\n", 0), 0U);
}

TEST(Summary, OfACatalogueMarksTheDefaults) {
  FakeServer server;
  server.catalogue = golden<v1::ListAlgorithmsResponse>("ListAlgorithmsResponse");
  EXPECT_EQ(printed(Client(server.address()).algorithms()),
            "6 algorithms; * are the defaults\n"
            "kind        name        what it does\n"
            "segmenter   tiling      Takes each tile for an object.\n"
            "segmenter   tracing *   Traces outlines.\n"
            "histogram   compass *   Counts directions.\n"
            "similarity  alikeness   Finds all alike.\n"
            "searcher    guessing *  Guesses.\n"
            "judge       weighing *  Weighs.");
}

}  // namespace sketchmatch::test
