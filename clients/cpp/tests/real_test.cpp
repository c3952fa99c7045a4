// A real server, whose address the environment tells: SKETCHMATCH_TEST_ADDRESS, and so on.
#include <gtest/gtest.h>
#include <sys/types.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <future>
#include <sketchmatch/sketchmatch.hpp>
#include <string>
#include <variant>
#include <vector>

namespace sketchmatch::test {

namespace {

std::string variable(const std::string& name) {
  const char* text = std::getenv(("SKETCHMATCH_TEST_" + name).c_str());  // NOLINT
  return text == nullptr ? "" : text;
}

std::string example(const std::string& name) { return variable("EXAMPLES") + "/" + name; }

Source sketch() { return sources::file(example("living_room_sketch.svg")); }

Source map() { return sources::map_server_map(example("living_room.yaml")); }

/// A grid of equal squares, for which no searcher finds the best map soon.
Source squares(int side) {
  std::vector<Ring> rings;
  for (int x = 0; x < side; ++x) {
    for (int y = 0; y < side; ++y) {
      const double left = 10.0 * x + 0.01 * y * x;
      const double low = 10.0 * y;
      rings.push_back({{left, low}, {left + 4, low}, {left + 4, low + 4}, {left, low + 4}});
    }
  }
  return sources::polygons(rings);
}

MatchOptions long_search() {
  MatchOptions options;
  options.searcher = "easm";
  options.params["searcher"]["generations"] = 1'000'000;
  return options;
}

class Real : public testing::Test {
 protected:
  void SetUp() override {
    if (variable("ADDRESS").empty()) {
      GTEST_SKIP() << "SKETCHMATCH_TEST_ADDRESS names no server";
    }
  }

  [[nodiscard]] static Client client() { return Client(variable("ADDRESS")); }
};

}  // namespace

TEST_F(Real, ALivingRoomIsMatchedWithProgress) {
  int progressed = 0;
  MatchOptions options;
  options.time_budget = std::chrono::seconds(60);
  const auto match =
      client().match(sketch(), map(), options, [&](const Progress& /*progress*/) { ++progressed; });
  EXPECT_EQ(match.object_map(),
            (ObjectMap{{0, 6}, {1, 4}, {2, 7}, {3, 5}, {4, 1}, {5, 0}, {6, 2}, {7, 3}}));
  EXPECT_GT(progressed, 0);
  EXPECT_EQ(match.accepted.time_budget, Seconds(60.0));
  EXPECT_EQ(match.scenes.sketch.objects.size(), 8U);
  EXPECT_GT(match.result.probability.value_or(0.0), 0.9);
  EXPECT_EQ(match.result.statistics.total_elapsed > Seconds(0.0), true);
}

TEST_F(Real, ASketchIsSegmented) {
  const auto found = client().segment(sketch());
  EXPECT_EQ(found.scene.objects.size(), 8U);
  EXPECT_EQ(found.scene.objects.at(2).label, "plant");
}

TEST_F(Real, ASceneIsKeptRelabelledAndForgotten) {
  const auto known = client();
  PutOptions options;
  options.title = "living room";
  const auto put = known.put_scene(sketch(), options);
  EXPECT_TRUE(put.created);
  EXPECT_EQ(put.stored_scene.title, "living room");
  EXPECT_FALSE(known.put_scene(sketch()).created);
  const auto& name = put.stored_scene.name;
  EXPECT_EQ(known.match(sources::stored_scene(name), map()).object_map().at(0), 6U);

  const auto other = known.update_scene(name, {{2, "cactus"}, {3, ""}}, "desert");
  EXPECT_NE(other.name, name);
  EXPECT_EQ(other.scene.objects.at(2).label, "cactus");
  EXPECT_EQ(other.scene.objects.at(3).label, "");
  const auto got = known.get_scene(name, true);
  EXPECT_EQ(got.stored_scene.scene.objects.at(2).label, "plant");
  ASSERT_TRUE(got.source);
  EXPECT_EQ(known.put_scene(*got.source).stored_scene.name, name);

  const auto listed = known.list_scenes();
  ASSERT_EQ(listed.size(), 2U);
  EXPECT_EQ(listed.at(0).name, other.name);
  EXPECT_EQ(listed.at(0).object_count, 8U);
  EXPECT_EQ(listed.at(0).title, "desert");
  EXPECT_EQ(listed.at(1).title, "living room");
  EXPECT_EQ(known.update_scene(name, {}, "").title, "");
  known.delete_scene(name);
  known.delete_scene(other.name);
  EXPECT_TRUE(known.list_scenes().empty());
  EXPECT_THROW(static_cast<void>(known.get_scene(name)), NotFoundError);
  EXPECT_THROW(known.delete_scene(name), NotFoundError);
  EXPECT_THROW(static_cast<void>(known.match(sources::stored_scene(name), map())), NotFoundError);
}

TEST_F(Real, AServerWithoutAStoreSaysSo) {
  ClientOptions options;
  options.root_certificates = variable("CA");
  options.token_file = variable("TOKEN_FILE");
  EXPECT_THROW(static_cast<void>(Client(variable("TLS_ADDRESS"), options).list_scenes()),
               StoreError);
}

TEST_F(Real, FeaturesAreCarriedThroughTheObjectsThatAreKnown) {
  const auto square = [](double left, double low, double side) -> Ring {
    return {{left, low}, {left + side, low}, {left + side, low + side}, {left, low + side}};
  };
  TransferOptions options;
  options.object_map = {{0, 1}, {1, 0}, {2, 2}};
  const auto carried = client().transfer(
      sources::polygons({square(0, 0, 1), square(6, 0, 1), square(0, 4, 1)}),
      sources::polygons({square(22, 10, 2), square(10, 10, 2), square(10, 18, 2)}),
      {{"dock", Point{3, 2}}, {"way", Route{{{1, 2}, {5, 2}}, {0.5, 0.25}}}}, options);
  EXPECT_FALSE(carried.match);
  EXPECT_EQ(carried.object_map(), options.object_map);
  ASSERT_EQ(carried.features.size(), 2U);
  EXPECT_EQ(carried.features.at(0).feature.name, "dock");
  const auto dock = std::get<Point>(carried.features.at(0).feature.kind);
  EXPECT_NEAR(dock.x, 16.0, 1e-6);
  EXPECT_NEAR(dock.y, 14.0, 1e-6);
  EXPECT_NEAR(std::get<Route>(carried.features.at(1).feature.kind).points.back().x, 20.0, 1e-6);
  EXPECT_EQ(std::get<Route>(carried.features.at(1).feature.kind).speeds_meters_per_second.front(),
            0.5);
  EXPECT_NEAR(carried.warp.scale, 2.0, 1e-6);

  options.object_map[3] = 0;
  try {
    static_cast<void>(client().transfer(sketch(), map(), {{"dock", Point{3, 2}}}, options));
    FAIL();
  } catch (const InvalidRequestError& error) {
    EXPECT_EQ(error.field().find("object_map"), 0U);
  }
}

TEST_F(Real, FeaturesAreCarriedThroughAMatch) {
  const auto carried = client().transfer(sketch(), map(), {{"dock", Point{300, -200}}});
  ASSERT_TRUE(carried.match);
  EXPECT_EQ(carried.object_map(),
            (ObjectMap{{0, 6}, {1, 4}, {2, 7}, {3, 5}, {4, 1}, {5, 0}, {6, 2}, {7, 3}}));
  EXPECT_EQ(carried.warp.weights.size(), 8U);
  EXPECT_EQ(carried.features.back().feature.name, "dock");
  EXPECT_EQ(carried.features.back().lines.at(0).deviations.size(), 1U);
}

TEST_F(Real, TheCatalogueAndTheInfoAreRead) {
  const auto catalogue = client().algorithms();
  EXPECT_GT(catalogue.algorithms.size(), 10U);
  const auto schema = catalogue.algorithms.front().parameters_schema;
  EXPECT_EQ(schema.at("type"), Value("object"));
  EXPECT_EQ(client().server_info().api_version, "sketchmatch.v1");
}

TEST_F(Real, HealthIsToldOfTheWholeAndItsParts) {
  client().wait_until_serving(std::chrono::seconds(60));
  EXPECT_TRUE(client().is_serving("sketchmatch.v1.MatchService"));
  EXPECT_THROW(static_cast<void>(client().is_serving("searcher/none")), InvalidRequestError);
}

TEST_F(Real, AWrongRequestNamesTheField) {
  MatchOptions options;
  options.params["searcher"]["wings"] = 2;
  try {
    static_cast<void>(client().match(sketch(), map(), options));
    FAIL();
  } catch (const InvalidRequestError& error) {
    EXPECT_EQ(error.reason(), "INVALID_PARAMETER");
    EXPECT_NE(error.field(), "");
    EXPECT_NE(error.remedy(), "");
  }
}

TEST_F(Real, ASearchCanBeCancelled) {
  const auto known = client();
  std::promise<void> begun;
  bool told = false;
  MatchCallbacks callbacks;
  callbacks.on_progress = [&](const Progress& progress) {
    if (progress.phase == Phase::search && !told) {
      told = true;
      begun.set_value();
    }
  };
  auto pending = known.match_async(squares(5), squares(6), long_search(), callbacks);
  ASSERT_EQ(begun.get_future().wait_for(std::chrono::minutes(2)), std::future_status::ready);
  pending.cancel();
  EXPECT_THROW(static_cast<void>(pending.get()), CallCancelledError);
}

TEST_F(Real, AServerThatIsKilledAmidAStreamIsUnavailable) {
  const auto pid = static_cast<pid_t>(std::stol(variable("DOOMED_PID")));
  ClientOptions options;
  options.retries = 0;
  const Client known(variable("DOOMED_ADDRESS"), options);
  bool killed = false;
  EXPECT_THROW(static_cast<void>(known.match(squares(5), squares(6), long_search(),
                                             [&](const Progress& /*progress*/) {
                                               if (!killed) {
                                                 killed = kill(pid, SIGKILL) == 0;
                                               }
                                             })),
               ServerUnavailableError);
  EXPECT_TRUE(killed);
  EXPECT_THROW(static_cast<void>(known.server_info()), ServerUnavailableError);
}

TEST_F(Real, AMatchGoesOnWhenItsServerIsKilledAndStartedAnew) {
  const auto pid = static_cast<pid_t>(std::stol(variable("PHOENIX_PID")));
  const Client known(variable("PHOENIX_ADDRESS"));
  auto options = long_search();
  options.time_budget = std::chrono::seconds(5);
  options.request_id = "phoenix";
  auto call = known.events(squares(5), squares(6), options);
  std::string told;
  bool killed = false;
  while (const auto event = call.next()) {
    if (event->index() != 2) {  // but for progress
      told += std::to_string(event->index());
    } else if (!killed) {
      killed = kill(pid, SIGKILL) == 0;
    }
  }
  EXPECT_TRUE(killed);
  EXPECT_EQ(told, "013");
  const auto match = call.result();
  EXPECT_EQ(match.object_map().size(), 25U);
  const auto record = known.get_match(match.accepted.match_id);
  EXPECT_EQ(record.match.state, MatchState::succeeded);
  EXPECT_EQ(record.match.request_id, "phoenix");
  EXPECT_EQ(record.match.last_event, call.last_event());
  EXPECT_EQ(known.watch(match.accepted.match_id).result().object_map(), match.object_map());
}

TEST_F(Real, AMatchThatIsToKeepRunningIsFoundAgain) {
  const auto known = client();
  auto options = long_search();
  options.keep_running = true;
  std::string match_id;
  {
    auto call = known.events(squares(5), squares(6), options);
    const auto event = call.next();
    ASSERT_TRUE(event);
    match_id = std::get<MatchAccepted>(*event).match_id;
  }
  auto watched = known.watch(match_id);
  EXPECT_TRUE(watched.next());
  EXPECT_NE(known.cancel_match(match_id).state, MatchState::succeeded);
  EXPECT_THROW(static_cast<void>(watched.result()), CallCancelledError);
  EXPECT_THROW(static_cast<void>(known.get_match("none")), NotFoundError);
}

TEST_F(Real, ATokenOverTlsLetsIn) {
  ClientOptions options;
  options.retries = 0;
  options.root_certificates = variable("CA");
  options.token_file = variable("TOKEN_FILE");
  const auto address = variable("TLS_ADDRESS");
  EXPECT_EQ(Client(address, options).match(sketch(), map()).object_map().size(), 8U);
  options.token_file.reset();
  EXPECT_THROW(static_cast<void>(Client(address, options).server_info()), NotAuthenticatedError);
  options.token = "robot-7.wrong";
  EXPECT_THROW(static_cast<void>(Client(address, options).server_info()), NotAuthenticatedError);
}

TEST_F(Real, AServerThatNobodyVouchesForIsNotTrusted) {
  ClientOptions options;
  options.retries = 0;
  options.tls = true;
  try {
    static_cast<void>(Client(variable("TLS_ADDRESS"), options).server_info());
    FAIL();
  } catch (const NotAuthenticatedError& error) {
    EXPECT_NE(std::string(error.what()).find("cannot be trusted"), std::string::npos);
  }
  options.tls.reset();
  options.root_certificates = variable("CA");
  options.server_name = "another.example";
  EXPECT_THROW(static_cast<void>(Client(variable("TLS_ADDRESS"), options).server_info()),
               NotAuthenticatedError);
}

TEST_F(Real, ACertificateOfTheClientLetsIn) {
  ClientOptions options;
  options.retries = 0;
  options.root_certificates = variable("CA");
  const auto address = variable("MUTUAL_ADDRESS");
  try {
    static_cast<void>(Client(address, options).server_info());
    FAIL();
  } catch (const ServerUnavailableError& error) {
    EXPECT_EQ(error.remedy(), "start it, or give root_certificates, certificate and key");
  }
  options.certificate = variable("CERTIFICATE");
  options.key = variable("KEY");
  EXPECT_EQ(Client(address, options).server_info().api_version, "sketchmatch.v1");
}

}  // namespace sketchmatch::test
