// The client builds the golden requests from plain values, and reads the golden responses.
#include "golden.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <map>
#include <optional>
#include <regex>
#include <set>
#include <sketchmatch/sketchmatch.hpp>
#include <sstream>
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

/// What the golden request of the turned scene asks.
struct Turned {
  Source sketch = sources::polygons({{{1, -1}, {5, -1}, {5, -3}, {1, -3}},
                                     {{7, -2}, {9, -2}, {9, -5}, {7, -5}},
                                     {{2, -6}, {3, -6}, {3, -11}, {2, -11}}},
                                    {"bed", "desk", "shelf"}, YAxis::down);
  Source map = sources::polygons_with_holes({{{{22, 14}, {28, 14}, {28, 18}, {22, 18}}},
                                             kBar,
                                             {{{26, 2}, {30, 2}, {30, 10}, {26, 10}}},
                                             {{{10, 4}, {20, 4}, {20, 6}, {10, 6}}}},
                                            {"table", "bar", "bunk", "rack"});
  MatchOptions options;

  Turned() {
    options.params["histogram"]["directions"] = 36;
    options.searcher = "exact";
    options.judge = "confidence";
    options.seed = 7;
    options.weights = Weights{1, 2, 3, 0.5, 0.25, 1.5};
    options.alternatives = 2;
  }
};

template <typename Error>
bool is(const SketchmatchError& error) {
  return dynamic_cast<const Error*>(&error) != nullptr;
}

/// Returns the name of an error's class.
std::string kind_of(const SketchmatchError& error) {
  static const std::map<std::string, bool (*)(const SketchmatchError&)> kinds{
      {"InvalidRequestError", is<InvalidRequestError>},
      {"ServerUnavailableError", is<ServerUnavailableError>},
      {"ServerBusyError", is<ServerBusyError>},
      {"DeadlineExceededError", is<DeadlineExceededError>},
      {"NotAuthenticatedError", is<NotAuthenticatedError>},
      {"NotFoundError", is<NotFoundError>},
      {"StoreError", is<StoreError>},
      {"NotSupportedError", is<NotSupportedError>},
      {"CallCancelledError", is<CallCancelledError>},
      {"ServerFailedError", is<ServerFailedError>}};
  for (const auto& [name, is_one] : kinds) {
    if (is_one(error)) {
      return name;
    }
  }
  return "";
}

/// Returns a message in text, as far as the client knows its fields.
template <typename Message>
std::string known_text(Message message) {
  forget_unknown(message);
  return as_text(message);
}

/// Checks that a value is all that a message says.
template <typename Value, typename Message>
void expect_told(const Value& value, const Message& message) {
  Message again;
  encode(value, again);
  EXPECT_EQ(as_text(again), known_text(message));
}

class Golden : public testing::Test {
 protected:
  FakeServer server;
  Client client{server.address()};

  template <typename Message>
  void expect_request(const std::string& name) {
    expect_request(golden<Message>(name));
  }

  template <typename Message>
  void expect_request(const Message& expected) {
    ASSERT_FALSE(server.requests().empty());
    // A name that the client made itself is nobody's to know.
    static const std::regex made("request_id: \"[0-9a-f]{32}\"\n");
    const auto sent = std::regex_replace(server.requests().back(), made, "");
    EXPECT_EQ(sent, known_text(expected));
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
  expect_told(record.match, server.record.match());
  ASSERT_EQ(record.events.size(), 2U);
  EXPECT_EQ(record.events.at(1).number, 5U);
  EXPECT_EQ(std::get<MatchResult>(record.events.at(1).event).outcome, Outcome::optimal);

  server.stopped = golden<v1::CancelMatchResponse>("CancelMatchResponse");
  expect_told(client.cancel_match("6f1c"), server.stopped.match());
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
  const Turned turned;
  server.events = {golden<v1::MatchResponse>("MatchResponse.turned")};
  const auto match = client.match(turned.sketch, turned.map, turned.options);
  expect_request<v1::MatchRequest>("MatchRequest.turned");
  EXPECT_EQ(match.object_map(), (ObjectMap{{0, 2}, {1, 0}, {2, 3}}));
}

TEST(GoldenAnswer, IsThatOfARealServer) {
  const char* address = std::getenv("SKETCHMATCH_TEST_ADDRESS");  // NOLINT
  if (address == nullptr) {
    GTEST_SKIP() << "SKETCHMATCH_TEST_ADDRESS names no server";
  }
  const Turned turned;
  const auto match = Client(address).match(turned.sketch, turned.map, turned.options);
  std::ostringstream said;
  said << std::fixed << std::setprecision(3);
  for (const auto& line : match.result.object_matches) {
    said << line.sketch_object << ' ' << line.sketch_label << " is " << line.map_object << ' '
         << line.map_label << ", confidence " << line.confidence << '\n';
  }
  const std::ifstream file(golden_folder() + "/said/MatchRequest.turned.txt");
  std::ostringstream expected;
  expected << file.rdbuf();
  EXPECT_EQ(said.str(), expected.str());
}

TEST_F(Golden, AStoredSceneIsPutAndFoundAgain) {
  server.put = golden<v1::PutSceneResponse>("PutSceneResponse");
  const auto source = sources::polygons_with_holes({kBar, {{{1.5, 2.5}, {4.5, 3.5}, {0.5, 6.5}}}},
                                                   {"bar", ""}, YAxis::down);
  expect_told(
      client.put_scene(
          source, {{"tracing", {{"closing", 0.125}, {"mode", "neat"}}, "careful"}, "snack bar"}),
      server.put);
  expect_request<v1::PutSceneRequest>("PutSceneRequest");

  server.got = golden<v1::GetSceneResponse>("GetSceneResponse");
  const auto got = client.get_scene(server.got.stored_scene().name(), true);
  expect_told(got, server.got);
  expect_request<v1::GetSceneRequest>("GetSceneRequest");
  EXPECT_EQ(got.stored_scene.scene.objects.at(0).label, "bar");
  ASSERT_TRUE(got.source);
  EXPECT_EQ(got.source->message().polygon_set().polygons_size(), 2);
  server.got.clear_source();
  EXPECT_FALSE(client.get_scene("5f2b").source);
}

TEST_F(Golden, TheLabelsOfAStoredSceneAreChangedAndItIsForgotten) {
  server.updated = golden<v1::UpdateSceneResponse>("UpdateSceneResponse");
  expect_told(client.update_scene(golden<v1::UpdateSceneRequest>("UpdateSceneRequest").name(),
                                  {{1, "rack"}, {3, ""}}, "rack room"),
              server.updated.stored_scene());
  expect_request<v1::UpdateSceneRequest>("UpdateSceneRequest");
  client.delete_scene(server.updated.stored_scene().name());
  expect_request<v1::DeleteSceneRequest>("DeleteSceneRequest");
}

TEST_F(Golden, AllPagesOfAListAreOne) {
  const auto first = golden<v1::ListScenesResponse>("ListScenesResponse");
  server.scene_pages = {first, first};
  const auto asked = golden<v1::ListScenesRequest>("ListScenesRequest");
  server.scene_pages.at(0).set_next_page_token(asked.page_token());
  server.scene_pages.at(1).mutable_scenes()->RemoveLast();
  server.scene_pages.at(1).clear_next_page_token();
  const auto scenes = client.list_scenes();
  expect_request(asked);
  EXPECT_EQ(server.requests().size(), 2U);
  EXPECT_EQ(server.requests().front(), "");
  ASSERT_EQ(scenes.size(), 3U);
  expect_told(scenes.at(0), first.scenes(0));
  expect_told(scenes.at(1), first.scenes(1));
  expect_told(scenes.at(2), first.scenes(0));
  EXPECT_EQ(scenes.at(1).object_count, 7U);
}

TEST_F(Golden, AllPagesOfMatchesAreOne) {
  const auto first = golden<v1::ListMatchesResponse>("ListMatchesResponse");
  server.match_pages = {first, {}};
  const auto matches = client.matches();
  auto asked = golden<v1::ListMatchesRequest>("ListMatchesRequest");
  asked.set_page_token(first.next_page_token());
  expect_request(asked);
  EXPECT_EQ(server.requests().size(), 2U);
  ASSERT_EQ(matches.size(), 2U);
  expect_told(matches.at(0), first.matches(0));
  expect_told(matches.at(1), first.matches(1));
}

TEST_F(Golden, FeaturesAreCarriedByAMatch) {
  TransferOptions options;
  static_cast<MatchOptions&>(options) = every_option();
  options.alternatives.reset();
  options.direction = TransferDirection::map_to_sketch;
  options.y_axis = YAxis::down;
  options.radius = 0.375;
  server.carried = golden<v1::TransferResponse>("TransferResponse");
  const auto carried =
      client.transfer(strokes(), grid(),
                      {{"dock", Point{1.25, -2.5}},
                       {"patrol", Route{{{3.5, 4.75}, {5.25, 0.125}, {9.5, 0}}, {0.5, 0.25, 0.75}}},
                       {"no-go", Zone{kBar}}},
                      options);
  expect_request<v1::TransferRequest>("TransferRequest");
  expect_told(carried, server.carried);
  EXPECT_EQ(carried.object_map(), (ObjectMap{{1, 3}, {2, 0}}));
  ASSERT_EQ(carried.features.size(), 5U);
  EXPECT_TRUE(carried.features.at(0).drawn);
  EXPECT_EQ(std::get<Route>(carried.features.at(0).feature.kind).points.at(1).x, 17.5);
  EXPECT_EQ(carried.features.at(0).changes.at(0).reason, ChangeReason::obstacle);
  EXPECT_EQ(std::get<Point>(carried.features.at(1).feature.kind).y, 2.25);
  EXPECT_EQ(std::get<Zone>(carried.features.at(3).feature.kind).rings.size(), 2U);
  EXPECT_TRUE(std::holds_alternative<std::monostate>(carried.features.at(4).feature.kind));
  EXPECT_EQ(carried.warp.kind, WarpKind::spline);
  ASSERT_TRUE(carried.match);
  EXPECT_EQ(carried.match->outcome, Outcome::iteration_limit);
}

TEST_F(Golden, FeaturesAreCarriedByAnObjectMapThatIsKnown) {
  TransferOptions options;
  options.object_map = {{1, 0}, {0, 2}};
  options.allow_unknown = true;
  // The golden message leaves the axis out.
  auto known = golden<v1::TransferRequest>("TransferRequest.known");
  known.mutable_sketch()->mutable_polygon_set()->set_y_axis(v1::Y_AXIS_UP);
  // Pairs have no order of their own.
  known.mutable_object_map()->SwapElements(0, 1);
  const auto carried =
      client.transfer(sources::polygons({{{1, 2}, {4, 2}, {4, 8}}, {{5, 3}, {9, 3}, {9, 6}}}),
                      sources::image_of(kPicture), {{"", Point{1.5, 2.5}}}, options);
  expect_request(known);
  EXPECT_FALSE(carried.match);
}

TEST_F(Golden, WhatIsForMatchesAloneIsRefusedForATransfer) {
  const auto field_of = [this](const TransferOptions& options,
                               const std::vector<Feature>& features) -> std::string {
    try {
      static_cast<void>(client.transfer(strokes(), grid(), features, options));
    } catch (const InvalidRequestError& error) {
      return error.what();
    }
    return "";
  };
  TransferOptions options;
  options.alternatives = 2;
  EXPECT_EQ(field_of(options, {}), "alternatives is only for matches; leave it out of a transfer");
  options = {};
  options.request_id = "3f0e";
  EXPECT_EQ(field_of(options, {}).find("request_id is only for matches"), 0U);
  options = {};
  options.keep_running = true;
  EXPECT_EQ(field_of(options, {}).find("keep_running is only for matches"), 0U);
  options = {};
  options.priority = Priority::low;
  EXPECT_EQ(field_of(options, {}).find("priority is only for matches"), 0U);
  EXPECT_EQ(field_of({}, {{"dock", Point{}}, {"attic", {}}}),
            "features[1] is empty; give a Point, a Route or a Zone");
  EXPECT_TRUE(server.requests().empty());
}

TEST_F(Golden, ASegmentationIsAskedForWithASegmenter) {
  static_cast<void>(client.segment(
      polygons(), {"tracing", {{"closing", 0.125}, {"mode", "neat"}}, "careful", true}));
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
            std::vector<std::string>{"the objects are from room.objects.geojson beside the map, "
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
  expect_told(match.accepted, server.events[0].accepted());
  expect_told(match.scenes, server.events[1].scenes());
  ASSERT_EQ(seen.size(), 1U);
  expect_told(seen[0], server.events[2].progress());
  expect_told(match.result, server.events[3].result());
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
  expect_told(client.segment(grid()), server.segments);
  expect_told(client.algorithms(), server.catalogue);
  expect_told(client.server_info(), server.info);
  server.info.mutable_limits()->MergeFrom(
      golden<v1::GetServerInfoResponse>("GetServerInfoResponse.limits").limits());
  expect_told(client.server_info(), server.info);
}

TEST_F(Golden, EachCodeIsAnErrorOfTheKindThatEveryClientHas) {
  std::ifstream file(golden_folder() + "/kinds.txt");
  ClientOptions once;
  once.retries = 0;
  const Client caller(server.address(), once);
  int count = 0;
  int code = 0;
  for (std::string name, kind, failure; file >> code >> name >> kind >> failure; ++count) {
    server.fail(status_of(static_cast<grpc::StatusCode>(code), "no"));
    try {
      static_cast<void>(caller.match(strokes(), grid()));
      ADD_FAILURE() << name;
    } catch (const SketchmatchError& error) {
      EXPECT_EQ(kind_of(error), kind) << name;
    }
  }
  EXPECT_EQ(count, 16);
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

TEST(GoldenMessages, EachOfAnyTypeIsReadByTheRawStubs) {
  const auto names = golden_names();
  EXPECT_GT(names.size(), 60U);
  for (const auto& name : names) {
    EXPECT_NO_THROW(static_cast<void>(any_golden(name))) << name;
  }
}

TEST(GoldenMessages, WhatTheClientDoesNotKnowYetIsLeftOutAndTheRestIsNot) {
  std::set<std::string> unknown;
  for (const char* name : {"MatchRequest", "MatchResponse.result", "TransferRequest",
                           "TransferResponse", "GetSceneResponse", "ListAlgorithmsResponse"}) {
    // The services' own messages hold nothing but what is looked into.
    const auto message = any_golden(name);
    auto* part = message.get();
    if (std::string(name) == "MatchResponse.result") {
      part = static_cast<v1::MatchResponse*>(part)->mutable_result();
    }
    unknown.merge(forget_unknown(*part));
  }
  for (const auto& name : unknown) {
    std::cout << "not known to the client: " << name << '\n';
  }
  v1::ListScenesRequest request;
  request.set_page_size(25);
  request.set_page_token("next");
  EXPECT_EQ(forget_unknown(request),
            std::set<std::string>{"sketchmatch.v1.ListScenesRequest.page_size"});
  EXPECT_EQ(as_text(request), "page_token: \"next\"\n");
}

}  // namespace sketchmatch::test
