// Calls: sent again where that helps, stopped where somebody asks for it, and over in time.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <limits>
#include <memory>
#include <sketchmatch/raw.hpp>
#include <sketchmatch/sketchmatch.hpp>
#include <string>
#include <thread>

#include "fake_server.hpp"

namespace sketchmatch::test {

namespace {

using std::chrono::milliseconds;
using Clock = std::chrono::steady_clock;

Source room() { return sources::polygons({{{0, 0}, {1, 0}, {1, 1}}, {{5, 5}, {6, 5}, {6, 6}}}); }

ClientOptions retrying(int times) {
  ClientOptions options;
  options.retries = times;
  return options;
}

class Calls : public testing::Test {
 protected:
  FakeServer server;
  Client client{server.address()};

  /// Makes the match of the server one that goes on until it is stopped.
  void go_on() {
    server.events.resize(3);
    server.endless = true;
  }
};

}  // namespace

TEST_F(Calls, EventsComeOneByOneAndUnknownOnesAreLeftOut) {
  auto call = client.events(room(), room());
  std::string kinds;
  while (const auto event = call.next()) {
    kinds += std::to_string(event->index());
  }
  EXPECT_EQ(kinds, "01223");
  EXPECT_FALSE(call.next());
  EXPECT_EQ(call.result().object_map(), (ObjectMap{{0, 2}, {1, 0}}));
}

TEST_F(Calls, AResultHoldsEventsThatWereReadBefore) {
  auto call = client.events(room(), room());
  EXPECT_TRUE(call.next());
  EXPECT_EQ(call.result().accepted.match_id, "m1");
}

TEST_F(Calls, AMatchStartsWhenItsFirstEventIsAskedFor) {
  { const auto call = client.events(room(), room()); }
  EXPECT_TRUE(server.requests().empty());
}

TEST_F(Calls, AStreamWithoutResultIsAnError) {
  server.events.resize(3);
  EXPECT_THROW(static_cast<void>(client.match(room(), room())), ServerFailedError);
}

TEST_F(Calls, AServerThatWasAwayForAMomentIsAskedAgain) {
  const Client patient(server.address(), retrying(2));
  const auto away = status_of(grpc::StatusCode::UNAVAILABLE, "away");
  server.fail(away, 2);
  static_cast<void>(patient.match(room(), room()));
  server.fail(away, 2);
  static_cast<void>(patient.segment(room()));
  server.fail(away, 2);
  static_cast<void>(patient.algorithms());
  server.fail(away, 2);
  static_cast<void>(patient.server_info());
  EXPECT_EQ(server.requests().size(), 12U);
  EXPECT_EQ(server.requests()[0], server.requests()[2]);
}

TEST_F(Calls, ABusyServerIsAskedAgainNoSoonerThanItSays) {
  server.fail(status_of(grpc::StatusCode::RESOURCE_EXHAUSTED, "full", "LIMIT_EXCEEDED", 0.4), 1);
  const auto began = Clock::now();
  static_cast<void>(client.match(room(), room()));
  EXPECT_GE(Clock::now() - began, milliseconds(400));
  EXPECT_EQ(server.requests().size(), 2U);
}

TEST_F(Calls, ItIsToldInTheEndIfNothingHelped) {
  server.fail(status_of(grpc::StatusCode::UNAVAILABLE, "away"));
  const Client patient(server.address(), retrying(2));
  EXPECT_THROW(static_cast<void>(patient.match(room(), room())), ServerUnavailableError);
  EXPECT_EQ(server.requests().size(), 3U);
}

TEST_F(Calls, WhatWouldFailAgainIsNotSentAgain) {
  server.fail(status_of(grpc::StatusCode::INVALID_ARGUMENT, "no"));
  EXPECT_THROW(static_cast<void>(client.match(room(), room())), InvalidRequestError);
  server.fail(status_of(grpc::StatusCode::RESOURCE_EXHAUSTED, "full"));  // which says not when
  EXPECT_THROW(static_cast<void>(client.match(room(), room())), ServerBusyError);
  server.fail(status_of(grpc::StatusCode::INTERNAL, "no"));
  EXPECT_THROW(static_cast<void>(client.server_info()), ServerFailedError);
  EXPECT_EQ(server.requests().size(), 3U);
}

TEST_F(Calls, AMatchOfAServerThatNumbersNoEventsIsNotSentAgain) {
  server.breaks_after = 3;
  EXPECT_THROW(static_cast<void>(client.match(room(), room())), ServerUnavailableError);
  EXPECT_EQ(server.requests().size(), 1U);
}

TEST_F(Calls, AStatusWithoutASentenceGetsOne) {
  server.fail(status_of(grpc::StatusCode::DATA_LOSS, ""), 1);
  try {
    static_cast<void>(client.server_info());
    FAIL();
  } catch (const ServerFailedError& error) {
    EXPECT_EQ(error.what(), "the server at " + server.address() + " reports DATA_LOSS");
  }
}

TEST_F(Calls, ARequestThatTheTransportRefusesIsTooLarge) {
  server.fail(status_of(grpc::StatusCode::RESOURCE_EXHAUSTED,
                        "Received message larger than max (9 vs. 4)"));
  try {
    static_cast<void>(client.segment(room()));
    FAIL();
  } catch (const InvalidRequestError& error) {
    EXPECT_EQ(error.reason(), "MESSAGE_TOO_LARGE");
    EXPECT_EQ(error.remedy(), "make it smaller");
  }
}

TEST_F(Calls, ADeadlineEndsAMatch) {
  go_on();
  CallOptions call;
  call.timeout = milliseconds(150);
  EXPECT_THROW(static_cast<void>(client.match(room(), room(), {}, {}, call)),
               DeadlineExceededError);
  EXPECT_TRUE(server.wait_until_cancelled());
}

TEST_F(Calls, TheClientsTimeoutHoldsUnlessTheCallHasItsOwn) {
  go_on();
  ClientOptions options;
  options.timeout = milliseconds(150);
  const Client hasty(server.address(), options);
  EXPECT_THROW(static_cast<void>(hasty.match(room(), room())), DeadlineExceededError);
  ASSERT_TRUE(server.wait_until_cancelled());
  server.endless = false;
  server.events = small_match();
  CallOptions call;
  call.timeout = Seconds(std::numeric_limits<double>::infinity());
  EXPECT_EQ(hasty.match(room(), room(), {}, {}, call).accepted.match_id, "m1");
}

TEST_F(Calls, AttemptsShareTheTimeOfACall) {
  server.fail(status_of(grpc::StatusCode::RESOURCE_EXHAUSTED, "full", "LIMIT_EXCEEDED", 0.9));
  CallOptions call;
  call.timeout = milliseconds(500);
  const auto began = Clock::now();
  EXPECT_THROW(static_cast<void>(client.match(room(), room(), {}, {}, call)), ServerBusyError);
  EXPECT_LT(Clock::now() - began, milliseconds(900));  // it does not wait in vain
}

TEST_F(Calls, ATimeoutThatIsNoneIsRefused) {
  for (const double seconds : {-1.0, std::numeric_limits<double>::quiet_NaN()}) {
    CallOptions call;
    call.timeout = Seconds(seconds);
    EXPECT_THROW(static_cast<void>(client.server_info(call)), InvalidRequestError);
    EXPECT_THROW(client.wait_until_serving(Seconds(seconds)), InvalidRequestError);
  }
  EXPECT_THROW(Client(server.address(), retrying(-1)), InvalidRequestError);
}

TEST_F(Calls, WhatACallbackThrowsEndsTheMatch) {
  go_on();
  const auto no = [](const Progress& /*progress*/) { throw std::runtime_error("no more"); };
  EXPECT_THROW(static_cast<void>(client.match(room(), room(), {}, no)), std::runtime_error);
  EXPECT_TRUE(server.wait_until_cancelled());
}

TEST_F(Calls, DroppingAMatchStopsIt) {
  go_on();
  {
    auto call = client.events(room(), room());
    EXPECT_TRUE(call.next());
  }
  EXPECT_TRUE(server.wait_until_cancelled());
}

TEST_F(Calls, AnotherThreadMayCancelAMatch) {
  go_on();
  auto call = client.events(room(), room());
  EXPECT_TRUE(call.next());
  std::thread button([&call] { call.cancel(); });
  try {
    static_cast<void>(call.result());
    ADD_FAILURE();
  } catch (const CallCancelledError& error) {
    EXPECT_STREQ(error.what(), "the match was cancelled before its end");
  }
  button.join();
  EXPECT_TRUE(server.wait_until_cancelled());
  EXPECT_THROW(call.next(), CallCancelledError);
}

TEST_F(Calls, ACancellationStopsEveryCallThatItWasGivenTo) {
  go_on();
  CallOptions call;
  std::thread button([&] {
    while (server.requests().empty()) {
      std::this_thread::sleep_for(milliseconds(1));
    }
    call.cancellation.cancel();
  });
  EXPECT_THROW(static_cast<void>(client.match(room(), room(), {}, {}, call)), CallCancelledError);
  button.join();
  EXPECT_TRUE(call.cancellation.cancelled());
  EXPECT_THROW(static_cast<void>(client.match(room(), room(), {}, {}, call)), CallCancelledError);
  EXPECT_THROW(static_cast<void>(client.segment(room(), {}, call)), CallCancelledError);
  EXPECT_THROW(static_cast<void>(client.is_serving("", call)), CallCancelledError);
  EXPECT_EQ(server.requests().size(), 1U);
}

TEST_F(Calls, CancellingOneMatchLeavesOthersOfTheSameCancellation) {
  CallOptions call;
  auto one = client.events(room(), room(), {}, call);
  auto other = client.events(room(), room(), {}, call);
  one.cancel();
  EXPECT_THROW(one.next(), CallCancelledError);
  EXPECT_EQ(other.result().accepted.match_id, "m1");
}

TEST_F(Calls, APauseBeforeTheNextAttemptCanBeCancelled) {
  server.fail(status_of(grpc::StatusCode::RESOURCE_EXHAUSTED, "full", "LIMIT_EXCEEDED", 0.99));
  CallOptions call;
  const Client patient(server.address(), retrying(1'000));
  std::thread button([&] {
    while (server.requests().empty()) {
      std::this_thread::sleep_for(milliseconds(1));
    }
    call.cancellation.cancel();
  });
  EXPECT_THROW(static_cast<void>(patient.match(room(), room(), {}, {}, call)), CallCancelledError);
  button.join();
}

TEST_F(Calls, AnAsynchronousMatchCallsBackAndFillsItsFuture) {
  std::atomic<int> progressed = 0;
  std::string matched;
  MatchCallbacks callbacks;
  callbacks.on_progress = [&](const Progress& progress) {
    EXPECT_TRUE(progress.confidence);
    ++progressed;
  };
  callbacks.on_match = [&](const Match& match) { matched = match.accepted.match_id; };
  callbacks.on_error = [](const SketchmatchError& error) { ADD_FAILURE() << error.what(); };
  auto pending = client.match_async(room(), room(), {}, callbacks);
  EXPECT_EQ(pending.get().object_map(), (ObjectMap{{0, 2}, {1, 0}}));
  EXPECT_EQ(matched, "m1");
  EXPECT_EQ(progressed, 2);
  EXPECT_EQ(pending.future().get().accepted.seed, 7U);
}

TEST_F(Calls, AnErrorReachesBothTheCallbackAndTheFuture) {
  server.fail(status_of(grpc::StatusCode::INVALID_ARGUMENT, "draw a line", "INVALID_STROKE"));
  std::string reason;
  MatchCallbacks callbacks;
  callbacks.on_error = [&](const SketchmatchError& error) { reason = error.reason(); };
  auto pending = client.match_async(room(), room(), {}, callbacks);
  EXPECT_THROW(static_cast<void>(pending.get()), InvalidRequestError);
  EXPECT_EQ(reason, "INVALID_STROKE");
}

TEST_F(Calls, WhatACallbackThrowsIsInTheFuture) {
  MatchCallbacks callbacks;
  callbacks.on_match = [](const Match& /*match*/) { throw std::logic_error("mine"); };
  auto pending = client.match_async(room(), room(), {}, callbacks);
  EXPECT_THROW(static_cast<void>(pending.get()), std::logic_error);
}

TEST_F(Calls, AnAsynchronousMatchCanBeCancelled) {
  go_on();
  auto pending = client.match_async(room(), room());
  EXPECT_EQ(pending.future().wait_for(milliseconds(20)), std::future_status::timeout);
  pending.cancel();
  EXPECT_THROW(static_cast<void>(pending.get()), CallCancelledError);
}

TEST_F(Calls, DroppingAnAsynchronousMatchStopsItAndItsFutureOutlivesIt) {
  go_on();
  std::atomic<bool> began = false;
  MatchCallbacks callbacks;
  callbacks.on_progress = [&](const Progress& /*progress*/) { began = true; };
  std::shared_future<Match> future;
  {
    const auto pending = client.match_async(room(), room(), {}, callbacks);
    future = pending.future();
    while (!began) {
      std::this_thread::sleep_for(milliseconds(1));
    }
  }
  EXPECT_THROW(static_cast<void>(future.get()), CallCancelledError);
  EXPECT_TRUE(server.wait_until_cancelled());
}

TEST_F(Calls, ACallbackMayDropItsMatch) {
  go_on();
  auto holder = std::make_shared<std::unique_ptr<AsyncMatch>>();
  std::promise<void> held;
  const auto ready = held.get_future().share();
  MatchCallbacks callbacks;
  callbacks.on_progress = [holder, ready](const Progress& /*progress*/) {
    ready.wait();
    holder->reset();
  };
  auto pending = client.match_async(room(), room(), {}, callbacks);
  const auto future = pending.future();
  *holder = std::make_unique<AsyncMatch>(std::move(pending));
  held.set_value();
  EXPECT_THROW(static_cast<void>(future.get()), CallCancelledError);
}

TEST_F(Calls, AMatchOutlivesItsClient) {
  auto pending = [&] { return Client(server.address()).match_async(room(), room()); }();
  EXPECT_EQ(pending.get().accepted.match_id, "m1");
}

TEST_F(Calls, ThreadsShareAClient) {
  std::vector<std::thread> threads;
  std::atomic<int> right = 0;
  threads.reserve(8);
  for (int k = 0; k < 8; ++k) {
    threads.emplace_back([&] {
      for (int n = 0; n < 20; ++n) {
        right += client.match(room(), room()).accepted.match_id == "m1" ? 1 : 0;
        right += client.server_info().api_version == "sketchmatch.v1" ? 1 : 0;
      }
    });
  }
  for (auto& thread : threads) {
    thread.join();
  }
  EXPECT_EQ(right, 8 * 20 * 2);
}

TEST_F(Calls, HealthIsToldByName) {
  EXPECT_TRUE(client.is_serving());
  EXPECT_TRUE(client.is_serving("sketchmatch.v1.MatchService"));
  server.set_serving(false);
  EXPECT_FALSE(client.is_serving());
  for (const std::string& name : {std::string("searcher/none"), std::string(200, 'x')}) {
    try {
      static_cast<void>(client.is_serving(name));
      ADD_FAILURE();
    } catch (const InvalidRequestError& error) {
      EXPECT_EQ(error.field(), "name");
    }
  }
}

TEST_F(Calls, OneCanWaitUntilAServerServes) {
  client.wait_until_serving();
  server.set_serving(false);
  try {
    client.wait_until_serving(milliseconds(120));
    FAIL();
  } catch (const ServerUnavailableError& error) {
    EXPECT_EQ(error.what(), "the sketchmatch server at " + server.address() +
                                " did not serve within 0.12 s; start it, check the address, or "
                                "wait longer");
  }
  std::thread late([&] {
    std::this_thread::sleep_for(milliseconds(50));
    server.set_serving(true);
  });
  client.wait_until_serving();
  late.join();
}

TEST_F(Calls, ACancelledWaitEnds) {
  server.set_serving(false);
  const Cancellation cancellation;
  cancellation.cancel();
  EXPECT_THROW(client.wait_until_serving(Seconds(600), cancellation), CallCancelledError);
}

TEST(Away, NobodyThereIsSaidInOneSentence) {
  const Client client("127.0.0.1:1", retrying(0));
  try {
    static_cast<void>(client.server_info());
    FAIL();
  } catch (const ServerUnavailableError& error) {
    EXPECT_EQ(std::string(error.what())
                  .rfind("the sketchmatch server at 127.0.0.1:1 is not "
                         "available; start it, or check the address (",
                         0),
              0U);
    EXPECT_EQ(error.remedy(), "start it, or check the address");
  }
}

TEST_F(Calls, TheRemedyOfALinkThatDidNotComeAboutIsOursAndNotWhatGrpcSays) {
  const std::string grpc = "failed to connect to all addresses; last error: UNKNOWN: ";
  for (const auto& [said, remedy] : {
           std::pair("Connection refused", "start it, or check the address"),
           std::pair("Socket closed", "start it, or give root_certificates, certificate and key"),
           std::pair("wrong version number",
                     "it does not use encryption: leave out certificates and tls"),
           std::pair("Trying to connect an http1.x server", "give the address for gRPC"),
       }) {
    server.fail(status_of(grpc::StatusCode::UNAVAILABLE, grpc + said));
    try {
      static_cast<void>(Client(server.address(), retrying(0)).server_info());
      FAIL();
    } catch (const ServerUnavailableError& error) {
      EXPECT_EQ(error.remedy(), remedy);
      EXPECT_EQ(std::string(error.what()).substr(std::string(error.what()).rfind(remedy)),
                std::string(remedy) + " (" + grpc + said + ")");
    }
  }
}

TEST_F(Calls, WhyACertificateIsNotTrustedIsSaidAsFarAsItIsKnown) {
  const std::string grpc = "last error: UNKNOWN: ipv4:127.0.0.1:1: Ssl handshake failed: ";
  for (const auto& [said, why] : {
           std::pair("SSL_ERROR_SSL: error:0A000086:SSL routines::certificate verify failed",
                     "it is of no authority that the client trusts, or it has expired"),
           std::pair("SSL_ERROR_SSL: error:1000007d:SSL routines:OPENSSL_internal:"
                     "CERTIFICATE_VERIFY_FAILED: certificate has expired",
                     "certificate has expired"),
           std::pair("Hostname Verification Check failed.", "it is for another name"),
       }) {
    server.fail(status_of(grpc::StatusCode::UNAVAILABLE, grpc + said));
    try {
      static_cast<void>(client.server_info());
      FAIL();
    } catch (const NotAuthenticatedError& error) {
      EXPECT_NE(std::string(error.what()).find("cannot be trusted (" + std::string(why) + "); "),
                std::string::npos)
          << error.what();
    }
  }
}

TEST(Away, AServerThatComesBackIsFoundAgain) {
  auto first = std::make_unique<FakeServer>();
  const int port = first->port();
  ClientOptions options;
  options.retries = 20;
  const Client client(first->address(), options);
  EXPECT_EQ(client.match(room(), room()).accepted.match_id, "m1");
  first.reset();
  std::unique_ptr<FakeServer> second;
  std::thread later([&] {
    std::this_thread::sleep_for(milliseconds(300));
    second = std::make_unique<FakeServer>(port);
  });
  EXPECT_EQ(client.match(room(), room()).accepted.match_id, "m1");
  later.join();
}

TEST_F(Calls, StubsOfTheContractShareConnectionTokenAndErrors) {
  ClientOptions options;
  options.token = "robot-7.secret";
  const Client known(server.address(), options);
  const auto stub = v1::CatalogService::NewStub(known.channel());
  server.fail(status_of(grpc::StatusCode::UNAUTHENTICATED, "no", "NOT_AUTHENTICATED"), 1);
  grpc::ClientContext context;
  known.authorize(context);
  v1::GetServerInfoResponse info;
  const auto status = stub->GetServerInfo(&context, {}, &info);
  EXPECT_THROW(known.check(status), NotAuthenticatedError);
  EXPECT_NO_THROW(known.check(grpc::Status::OK));
  EXPECT_EQ(server.authorizations(), std::vector<std::string>{"Bearer robot-7.secret"});
}

}  // namespace sketchmatch::test
