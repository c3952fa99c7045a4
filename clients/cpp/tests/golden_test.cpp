// The client builds the golden requests from plain values, and reads the golden responses.
#include "golden.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <optional>
#include <regex>
#include <set>
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
                                      YAxis::down, {std::nullopt, 0.375});
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

/// Reads a golden message of a method that the client does not wrap, as the raw stubs have it.
template <typename Message>
std::string raw(const std::string& name) {
  EXPECT_NO_THROW(static_cast<void>(golden<Message>(name)));
  return name;
}

class Golden : public testing::Test {
 protected:
  FakeServer server;
  Client client{server.address()};

  template <typename Message>
  void expect_request(const std::string& name) {
    ASSERT_FALSE(server.requests().empty());
    // A name that the client made itself is nobody's to know.
    static const std::regex made("request_id: \"[0-9a-f]{32}\"\n");
    EXPECT_EQ(std::regex_replace(server.requests().back(), made, ""),
              as_text(golden<Message>(name)));
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

TEST_F(Golden, AMatchThatHasANameIsAskedFor) {
  MatchOptions options;
  options.request_id = "3f0e-17";
  options.keep_running = true;
  options.priority = Priority::high;
  static_cast<void>(client.match(sources::polygons({{{1, 2}, {4, 2}, {4, 8}}}),
                                 sources::polygons({{{5, 3}, {9, 3}, {9, 6}}}), options));
  expect_request<v1::MatchRequest>("MatchRequest.named");
}

TEST_F(Golden, AMatchOfStoredScenesIsAskedFor) {
  const auto sixteen_times = [](const std::string& four) {
    std::string name;
    for (int k = 0; k < 16; ++k) {
      name += four;
    }
    return name;
  };
  static_cast<void>(client.match(sources::stored_scene(sixteen_times("5f2b")),
                                 sources::stored_scene(sixteen_times("c07d"))));
  expect_request<v1::MatchRequest>("MatchRequest.stored");
}

TEST_F(Golden, AMatchIsAskedForByItsName) {
  server.record = golden<v1::GetMatchResponse>("GetMatchResponse");
  const auto record = client.get_match("6f1c");
  expect_request<v1::GetMatchRequest>("GetMatchRequest");
  EXPECT_EQ(as_text(encoded(record.match)), as_text(server.record.match()));
  ASSERT_EQ(record.events.size(), 2U);
  EXPECT_EQ(record.events.at(1).number, 5U);
  EXPECT_EQ(std::get<MatchResult>(record.events.at(1).event).outcome, Outcome::optimal);

  server.stopped = golden<v1::CancelMatchResponse>("CancelMatchResponse");
  EXPECT_EQ(as_text(encoded(client.cancel_match("6f1c"))), as_text(server.stopped.match()));
  expect_request<v1::CancelMatchRequest>("CancelMatchRequest");
}

TEST_F(Golden, AMatchIsWatchedFromAnEventOn) {
  server.events = {golden<v1::WatchMatchResponse>("WatchMatchResponse").event()};
  const auto match = client.watch("6f1c", 2).result();
  expect_request<v1::WatchMatchRequest>("WatchMatchRequest");
  EXPECT_EQ(match.result.match_id, "6f1c");
  EXPECT_EQ(match.result.outcome, Outcome::optimal);
}

TEST_F(Golden, TheNumberOfAnEventIsKnown) {
  server.events = {golden<v1::MatchResponse>("MatchResponse.numbered")};
  auto call = client.events(strokes(), grid());
  EXPECT_EQ(std::get<Progress>(call.next().value()).confidence, 0.625);
  EXPECT_EQ(call.last_event(), 4294967303U);
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

  std::ofstream(folder / "room.objects.geojson")
      << golden<v1::SegmentRequest>("SegmentRequest.mended_map")
             .source()
             .map_server_map()
             .objects();
  const auto mended = sources::map_server_map(folder / "room.yaml");
  fs::remove(folder / "room.objects.geojson");
  expect_segment_request(mended, "SegmentRequest.mended_map");
  EXPECT_EQ(mended.notes(),
            std::vector<std::string>{"objects are those of room.objects.geojson beside the map, "
                                     "unless a segmenter is chosen"});
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
  server.info.mutable_limits()->MergeFrom(
      golden<v1::GetServerInfoResponse>("GetServerInfoResponse.limits").limits());
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

TEST_F(Golden, WhatTheServerDoesNotKeepIsNotFound) {
  const auto error = error_of<NotFoundError>("not_found");
  ASSERT_TRUE(error);
  EXPECT_EQ(error->reason(), "NOT_FOUND");
}

TEST_F(Golden, AStoreThatFailsIsSaid) {
  const auto error = error_of<StoreError>("failed_precondition");
  ASSERT_TRUE(error);
  EXPECT_EQ(error->reason(), "STORE_UNAVAILABLE");
}

TEST_F(Golden, AMatchThatWasCancelledElsewhereIsSaid) {
  const auto error = error_of<CallCancelledError>("cancelled");
  ASSERT_TRUE(error);
  EXPECT_EQ(error->reason(), "MATCH_CANCELLED");
}

TEST_F(Golden, AMatchThatWasInterruptedMayBeSentAgain) {
  const auto error = error_of<ServerUnavailableError>("interrupted");
  ASSERT_TRUE(error);
  EXPECT_EQ(error->reason(), "MATCH_INTERRUPTED");
  EXPECT_EQ(error->retry_after(), Seconds(1.0));
}

TEST_F(Golden, APluginThatFailedIsTheServersFault) {
  const auto error = error_of<ServerFailedError>("internal");
  ASSERT_TRUE(error);
  EXPECT_EQ(error->reason(), "PLUGIN_FAILED");
}

TEST(GoldenMessages, EachIsOneOfTheClientsOrReachedByTheRawStubs) {
  const std::set<std::string> clients{"CancelMatchRequest",
                                      "CancelMatchResponse",
                                      "GetMatchRequest",
                                      "GetMatchResponse",
                                      "GetServerInfoRequest",
                                      "GetServerInfoResponse",
                                      "GetServerInfoResponse.limits",
                                      "ListAlgorithmsRequest",
                                      "ListAlgorithmsResponse",
                                      "MatchRequest",
                                      "MatchRequest.named",
                                      "MatchRequest.sparse",
                                      "MatchRequest.stored",
                                      "MatchRequest.turned",
                                      "MatchResponse.accepted",
                                      "MatchResponse.numbered",
                                      "MatchResponse.progress",
                                      "MatchResponse.result",
                                      "MatchResponse.scenes",
                                      "MatchResponse.turned",
                                      "SegmentRequest",
                                      "SegmentRequest.file",
                                      "SegmentRequest.image",
                                      "SegmentRequest.map_server_map",
                                      "SegmentRequest.mended_map",
                                      "SegmentRequest.occupancy_grid",
                                      "SegmentRequest.stroke_set",
                                      "SegmentResponse",
                                      "Status.cancelled",
                                      "Status.deadline_exceeded",
                                      "Status.failed_precondition",
                                      "Status.internal",
                                      "Status.interrupted",
                                      "Status.invalid_argument",
                                      "Status.not_found",
                                      "Status.resource_exhausted",
                                      "Status.unavailable",
                                      "WatchMatchRequest",
                                      "WatchMatchResponse"};
  const std::set<std::string> others{
      raw<v1::CreateSketchRequest>("CreateSketchRequest"),
      raw<v1::CreateSketchResponse>("CreateSketchResponse"),
      raw<v1::DeleteSceneRequest>("DeleteSceneRequest"),
      raw<v1::DeleteSceneResponse>("DeleteSceneResponse"),
      raw<v1::DeleteSketchRequest>("DeleteSketchRequest"),
      raw<v1::DeleteSketchResponse>("DeleteSketchResponse"),
      raw<v1::GetSceneRequest>("GetSceneRequest"),
      raw<v1::GetSceneResponse>("GetSceneResponse"),
      raw<v1::GetSceneResponse>("GetSceneResponse.mended"),
      raw<v1::ListMatchesRequest>("ListMatchesRequest"),
      raw<v1::ListMatchesResponse>("ListMatchesResponse"),
      raw<v1::ListScenesRequest>("ListScenesRequest"),
      raw<v1::ListScenesResponse>("ListScenesResponse"),
      raw<v1::PutSceneRequest>("PutSceneRequest"),
      raw<v1::PutSceneResponse>("PutSceneResponse"),
      raw<v1::TransferRequest>("TransferRequest"),
      raw<v1::TransferRequest>("TransferRequest.known"),
      raw<v1::TransferResponse>("TransferResponse"),
      raw<v1::UpdateSceneRequest>("UpdateSceneRequest"),
      raw<v1::UpdateSceneResponse>("UpdateSceneResponse"),
      raw<v1::UpdateSketchRequest>("UpdateSketchRequest"),
      raw<v1::UpdateSketchResponse>("UpdateSketchResponse"),
      raw<v1::WatchSketchRequest>("WatchSketchRequest"),
      raw<v1::WatchSketchResponse>("WatchSketchResponse.map"),
      raw<v1::WatchSketchResponse>("WatchSketchResponse.objects"),
      raw<v1::WatchSketchResponse>("WatchSketchResponse.problem"),
      raw<v1::WatchSketchResponse>("WatchSketchResponse.progress"),
      raw<v1::WatchSketchResponse>("WatchSketchResponse.result"),
  };
  std::set<std::string> all = clients;
  all.insert(others.begin(), others.end());
  std::set<std::string> there;
  for (const auto& entry : fs::directory_iterator(golden_folder())) {
    if (entry.path().extension() == ".json") {
      there.insert(entry.path().stem().string());
    }
  }
  EXPECT_EQ(all, there);
}

}  // namespace sketchmatch::test
