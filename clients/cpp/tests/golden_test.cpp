// The client builds the golden requests from plain values, and reads the golden responses.
#include "golden.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <optional>
#include <sketchmatch/sketchmatch.hpp>
#include <string>
#include <vector>

#include "encoding.hpp"
#include "fake_server.hpp"

namespace sketchmatch::test {

namespace {

namespace fs = std::filesystem;

const std::string kPicture = "P2\n3 2\n255\n0 64 128 192 224 255\n";
const std::string kYaml =
    "image: room.pgm\nresolution: 0.25\norigin: [-1.5, 2.25, 0.75]\nnegate: 0\n"
    "occupied_thresh: 0.65\nfree_thresh: 0.196\n";
const std::vector<Ring> kBar = {{{2, 12}, {8, 12}, {8, 20}, {2, 20}},
                                {{3, 17}, {5, 17}, {5, 13}, {3, 13}}};

Source strokes() {
  return sources::strokes(
      {{{1.5, 2.5, 0.25}, {3.5, 4.75, 0.5}, {5.25, 0.125, 0.875}}, {{7.5, -8.5}, {9.25, 6.5}}},
      {"sofa", "route"}, YAxis::down);
}

Source polygons() {
  return sources::polygons_with_holes({kBar, {{{1.5, 2.5}, {4.5, 3.5}, {0.5, 6.5}}}}, {"bar", ""},
                                      YAxis::down);
}

Source grid() {
  return sources::occupancy_grid({0, 100, -1, 0, 100, 30}, 3, 0.05, {-1.5, 2.25, 0.75});
}

MatchOptions every_option() {
  MatchOptions options;
  options.sketch_segmenter = "tracing";
  options.map_segmenter = "tiling";
  options.histogram = "compass";
  options.similarity = "alikeness";
  options.searcher = "guessing";
  options.judge = "weighing";
  options.params["sketch_segmenter"] = {{"closing", 0.125}, {"mode", "neat"}};
  options.params["map_segmenter"] = {{"least", nullptr}, {"walls", true}};
  options.params["histogram"]["directions"] = 36;
  options.params["similarity"]["shares"] = Value::List{0.5, "rest", false};
  options.params["searcher"]["limits"] = Value::Object{{"rounds", 9}, {"quiet", true}};
  options.params["judge"]["scales"] = Value::List{"gold", 2.5};
  options.profile = "careful";
  options.seed = (std::uint64_t{1} << 53U) + 1;
  options.time_budget = Seconds(3.25);
  options.weights = Weights{1.5, 2.5, 0.75, 0.5, 0.25, 1.25};
  options.alternatives = 5;
  options.allow_unmatched = true;
  options.unmatched_price = 0.4375;
  options.pins = {Pin{"sofa", 3}, Pin{0, "couch", true}, Pin{2, std::nullopt}};
  options.synonyms = {{"couch", "sofa", "settee"}, {"desk", "bureau"}};
  return options;
}

class Golden : public testing::Test {
 protected:
  FakeServer server;
  Client client{server.address()};

  template <typename Message>
  void expect_request(const std::string& name) {
    ASSERT_FALSE(server.requests().empty());
    EXPECT_EQ(server.requests().back(), as_text(golden<Message>(name)));
  }

  void expect_segment_request(const Source& source, const std::string& name) {
    static_cast<void>(client.segment(source));
    expect_request<v1::SegmentRequest>(name);
  }

  template <typename Error>
  std::optional<Error> error_of(const std::string& status) {
    server.fail(golden<google::rpc::Status>("Status." + status));
    ClientOptions once;
    once.retries = 0;
    try {
      static_cast<void>(Client(server.address(), once).match(strokes(), grid()));
    } catch (const Error& error) {
      EXPECT_EQ(error.what(), golden<google::rpc::Status>("Status." + status).message());
      return error;
    }
    return std::nullopt;
  }
};

}  // namespace

TEST_F(Golden, AMatchWithEveryOptionIsAskedFor) {
  static_cast<void>(client.match(strokes(), grid(), every_option()));
  expect_request<v1::MatchRequest>("MatchRequest");
}

TEST_F(Golden, AMatchWithFewOptionsIsAskedFor) {
  MatchOptions options;
  options.params["searcher"]["rounds"] = 4;
  options.weights = Weights{0.5, 0.0, 2.0, {}, {}, {}};
  options.allow_unmatched = false;
  static_cast<void>(client.match(
      sources::image_of(kPicture),
      sources::polygons({{{1, 2}, {4, 2}, {4, 8}}, {{5, 3}, {9, 3}, {9, 6}}}), options));
  expect_request<v1::MatchRequest>("MatchRequest.sparse");
}

TEST_F(Golden, TheTurnedSceneIsAskedForAndAnswered) {
  MatchOptions options;
  options.params["histogram"]["directions"] = 36;
  options.searcher = "exact";
  options.judge = "confidence";
  options.seed = 7;
  options.weights = Weights{1, 2, 3, 0.5, 0.25, 1.5};
  options.alternatives = 2;
  server.events = {golden<v1::MatchResponse>("MatchResponse.turned")};
  const auto match =
      client.match(sources::polygons({{{1, -1}, {5, -1}, {5, -3}, {1, -3}},
                                      {{7, -2}, {9, -2}, {9, -5}, {7, -5}},
                                      {{2, -6}, {3, -6}, {3, -11}, {2, -11}}},
                                     {"bed", "desk", "shelf"}, YAxis::down),
                   sources::polygons_with_holes({{{{22, 14}, {28, 14}, {28, 18}, {22, 18}}},
                                                 kBar,
                                                 {{{26, 2}, {30, 2}, {30, 10}, {26, 10}}},
                                                 {{{10, 4}, {20, 4}, {20, 6}, {10, 6}}}},
                                                {"table", "bar", "bunk", "rack"}),
                   options);
  expect_request<v1::MatchRequest>("MatchRequest.turned");
  EXPECT_EQ(match.object_map(), (ObjectMap{{0, 2}, {1, 0}, {2, 3}}));
}

TEST_F(Golden, ASegmentationIsAskedForWithASegmenter) {
  static_cast<void>(
      client.segment(polygons(), {"tracing", {{"closing", 0.125}, {"mode", "neat"}}, "careful"}));
  expect_request<v1::SegmentRequest>("SegmentRequest");
}

TEST_F(Golden, EachOtherFormOfSourceIsSent) {
  expect_segment_request(sources::strokes({{{1.5, 2.5}, {3.5, 4.75}, {5.25, 0.125}}}, {"lamp"}),
                         "SegmentRequest.stroke_set");
  expect_segment_request(sources::occupancy_grid({0, 100, -1, 0, 100, 30}, 2, 0.125),
                         "SegmentRequest.occupancy_grid");
  expect_segment_request(sources::image_of(kPicture), "SegmentRequest.image");
  expect_segment_request(sources::file_of("1.5 2.5 4.5 3.5 0.5 6.5", "room.sheet", "cellar"),
                         "SegmentRequest.file");

  const auto folder = fs::path(testing::TempDir()) / "sketchmatch_golden";
  fs::create_directories(folder);
  std::ofstream(folder / "room.yaml") << kYaml;
  std::ofstream(folder / "room.pgm") << "P2\n3 2\n255\n0 254 128\n254 0 254\n";
  expect_segment_request(sources::map_server_map(folder / "room.yaml"),
                         "SegmentRequest.map_server_map");
}

TEST_F(Golden, TheCatalogueAndTheServersInfoAreAskedFor) {
  static_cast<void>(client.algorithms());
  expect_request<v1::ListAlgorithmsRequest>("ListAlgorithmsRequest");
  static_cast<void>(client.server_info());
  expect_request<v1::GetServerInfoRequest>("GetServerInfoRequest");
}

TEST_F(Golden, AStreamBecomesAMatchThatLacksNothing) {
  server.events = golden_match();
  std::vector<Progress> seen;
  const auto match = client.match(strokes(), grid(), {},
                                  [&](const Progress& progress) { seen.push_back(progress); });
  EXPECT_EQ(as_text(encoded(match.accepted)), as_text(server.events[0].accepted()));
  EXPECT_EQ(as_text(encoded(match.scenes)), as_text(server.events[1].scenes()));
  ASSERT_EQ(seen.size(), 1U);
  EXPECT_EQ(as_text(encoded(seen[0])), as_text(server.events[2].progress()));
  EXPECT_EQ(as_text(encoded(match.result)), as_text(server.events[3].result()));
}

TEST_F(Golden, TheNumbersOfAMatchAreThoseThatAreWritten) {
  server.events = golden_match();
  const auto match = client.match(strokes(), grid());
  EXPECT_EQ(match.object_map(), (ObjectMap{{1, 3}, {2, 0}}));
  EXPECT_EQ(match.accepted.seed, 9007199254740993U);
  EXPECT_EQ(match.accepted.pipeline.sketch_segmenter.parameters.at("mode"), Value("neat"));
  EXPECT_EQ(match.accepted.pipeline.map_segmenter.parameters.at("least"), Value(nullptr));
  EXPECT_EQ(match.scenes.map.objects.at(1).centroid.y, 16.2);
  EXPECT_EQ(match.result.outcome, Outcome::iteration_limit);
  EXPECT_EQ(match.result.rotation_radians, 1.75);
  EXPECT_EQ(match.result.probability, 0.365);
  EXPECT_EQ(match.result.statistics.total_elapsed, Seconds(2.625));
}

TEST_F(Golden, TheAnswersOfTheOtherMethodsLackNothing) {
  server.segments = golden<v1::SegmentResponse>("SegmentResponse");
  server.catalogue = golden<v1::ListAlgorithmsResponse>("ListAlgorithmsResponse");
  server.info = golden<v1::GetServerInfoResponse>("GetServerInfoResponse");
  EXPECT_EQ(as_text(encoded(client.segment(grid()))), as_text(server.segments));
  EXPECT_EQ(as_text(encoded(client.algorithms())), as_text(server.catalogue));
  EXPECT_EQ(as_text(encoded(client.server_info())), as_text(server.info));
}

TEST_F(Golden, ARequestThatCannotBeUsedNamesItsFieldAndTheRemedy) {
  const auto error = error_of<InvalidRequestError>("invalid_argument");
  ASSERT_TRUE(error);
  EXPECT_EQ(error->reason(), "INVALID_STROKE");
  EXPECT_EQ(error->field(), "sketch.stroke_set.strokes[3]");
  EXPECT_EQ(error->remedy(), "draw a line");
}

TEST_F(Golden, ABusyServerSaysWhenToComeBack) {
  const auto error = error_of<ServerBusyError>("resource_exhausted");
  ASSERT_TRUE(error);
  EXPECT_EQ(error->reason(), "LIMIT_EXCEEDED");
  EXPECT_EQ(error->retry_after(), Seconds(1.0));
}

TEST_F(Golden, AServerThatLostAWorkerSaysWhenToSendAgain) {
  const auto error = error_of<ServerUnavailableError>("unavailable");
  ASSERT_TRUE(error);
  EXPECT_EQ(error->reason(), "WORKER_LOST");
  EXPECT_EQ(error->retry_after(), Seconds(2.0));
}

TEST_F(Golden, ATimeBudgetThatWasTooShortKeepsTheServersSentence) {
  const auto error = error_of<DeadlineExceededError>("deadline_exceeded");
  ASSERT_TRUE(error);
  EXPECT_EQ(error->reason(), "TIME_BUDGET_EXHAUSTED");
}

TEST_F(Golden, APluginThatFailedIsTheServersFault) {
  const auto error = error_of<ServerFailedError>("internal");
  ASSERT_TRUE(error);
  EXPECT_EQ(error->reason(), "PLUGIN_FAILED");
}

}  // namespace sketchmatch::test
