// A match is one stream for who reads it, however often the link or the server is lost.
#include <gtest/gtest.h>

#include <iterator>
#include <sketchmatch/raw.hpp>
#include <sketchmatch/sketchmatch.hpp>
#include <string>
#include <vector>

#include "fake_server.hpp"
#include "golden.hpp"

namespace sketchmatch::test {

namespace {

Source room() { return sources::polygons({{{0, 0}, {1, 0}, {1, 1}}, {{5, 5}, {6, 5}, {6, 6}}}); }

MatchOptions to_keep_running() {
  MatchOptions options;
  options.keep_running = true;
  return options;
}

/// Returns the kinds of all events that a match still tells, as their places in `MatchEvent`.
std::string kinds_of(MatchCall call) {
  std::string kinds;
  while (const auto event = call.next()) {
    kinds += std::to_string(event->index());
  }
  return kinds;
}

std::string watching(const std::string& match_id, std::uint64_t after) {
  v1::WatchMatchRequest request;
  request.set_match_id(match_id);
  request.set_after(after);
  return as_text(request);
}

class Courses : public testing::Test {
 protected:
  void SetUp() override {
    for (std::size_t k = 0; k < server.events.size(); ++k) {
      server.events.at(k).set_number(k + 1);
    }
    v1::CancelMatchRequest request;
    request.set_match_id("m1");
    cancelling = as_text(request);
  }

  FakeServer server;
  Client client{server.address()};
  std::string cancelling;
};

}  // namespace

TEST_F(Courses, AMatchGoesOnAfterTheEventAtWhichTheLinkWasLost) {
  for (std::size_t count = 1; count < server.events.size(); ++count) {
    server.breaks_after = count;
    EXPECT_EQ(kinds_of(client.events(room(), room())), "01223");
    EXPECT_EQ(server.requests().size(), 2 * count);
    EXPECT_EQ(server.requests().back(), watching("m1", count));
  }
}

TEST_F(Courses, ALinkThatIsLostAfterTheResultTakesNothingAway) {
  server.breaks_after = server.events.size();
  EXPECT_EQ(client.match(room(), room()).object_map(), (ObjectMap{{0, 2}, {1, 0}}));
  EXPECT_EQ(server.requests().size(), 1U);
}

TEST_F(Courses, AMatchThatTheServerForgotIsSentAgainAndToldOnce) {
  server.breaks_after = 3;
  server.forgets = true;
  EXPECT_EQ(kinds_of(client.events(room(), room())), "012223");
  ASSERT_EQ(server.requests().size(), 3U);
  EXPECT_EQ(server.requests().at(1), watching("m1", 3));
  EXPECT_EQ(server.requests().at(2), server.requests().at(0));
}

TEST_F(Courses, AMatchThatIsDoneAgainTellsNoLessThanWasKnown) {
  server.breaks_after = 5;  // when 0.75 is known, which 0.5 does not exceed
  server.forgets = true;
  std::vector<double> known;
  static_cast<void>(client.match(room(), room(), {}, [&](const Progress& progress) {
    known.push_back(progress.confidence.value());
  }));
  EXPECT_EQ(known, (std::vector<double>{0.5, 0.75, 0.75}));
}

TEST_F(Courses, ProgressWithoutAConfidenceIsToldAfterTheSearchToo) {
  v1::MatchResponse joining;
  joining.mutable_progress()->set_fraction(0.5);
  server.events.insert(std::prev(server.events.end()), joining);
  std::vector<bool> known;
  static_cast<void>(client.match(room(), room(), {}, [&](const Progress& progress) {
    known.push_back(progress.confidence.has_value());
  }));
  EXPECT_EQ(known, (std::vector<bool>{true, true, false}));
}

TEST_F(Courses, WhoWantsNoRetriesIsToldAtOnce) {
  server.breaks_after = 2;
  ClientOptions options;
  options.retries = 0;
  EXPECT_THROW(static_cast<void>(Client(server.address(), options).match(room(), room())),
               ServerUnavailableError);
  EXPECT_EQ(server.requests().size(), 1U);
}

TEST_F(Courses, EachMatchHasANameOfItsOwn) {
  static_cast<void>(client.match(room(), room()));
  static_cast<void>(client.match(room(), room()));
  ASSERT_EQ(server.requests().size(), 2U);
  EXPECT_NE(server.requests().at(0), server.requests().at(1));
}

TEST_F(Courses, AMatchThatIsWatchedBeginsAfterTheEventThatIsKnown) {
  auto call = client.watch("m1", 4);
  EXPECT_EQ(call.last_event(), 4U);
  EXPECT_TRUE(call.next());
  EXPECT_EQ(call.last_event(), 5U);
  EXPECT_EQ(kinds_of(std::move(call)), "3");
  server.forgets = true;
  EXPECT_THROW(client.watch("m1").next(), NotFoundError);
  EXPECT_THROW(static_cast<void>(client.watch("\xFF")), InvalidRequestError);
}

TEST_F(Courses, CancellingAMatchThatWouldKeepRunningAsksTheServerToStopIt) {
  server.events.resize(3);
  server.endless = true;
  auto call = client.events(room(), room(), to_keep_running());
  EXPECT_TRUE(call.next());
  call.cancel();
  EXPECT_THROW(static_cast<void>(call.result()), CallCancelledError);
  EXPECT_EQ(server.requests().back(), cancelling);
}

TEST_F(Courses, ACancelledMatchThatNobodyReadsAnyMoreIsStoppedToo) {
  server.events.resize(3);
  server.endless = true;
  {
    auto call = client.events(room(), room(), to_keep_running());
    EXPECT_TRUE(call.next());
    call.cancel();
  }
  EXPECT_EQ(server.requests().back(), cancelling);
}

TEST_F(Courses, DroppingAMatchThatIsToKeepRunningStopsItNot) {
  server.events.resize(3);
  server.endless = true;
  {
    auto call = client.events(room(), room(), to_keep_running());
    EXPECT_TRUE(call.next());
  }
  { const auto pending = client.match_async(room(), room(), to_keep_running()); }
  for (const auto& request : server.requests()) {
    EXPECT_NE(request, cancelling);
  }
}

}  // namespace sketchmatch::test
