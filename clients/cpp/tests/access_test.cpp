// How a client gets in: addresses, tokens and certificates, from options and the environment.
#include <grpcpp/security/credentials.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sketchmatch/sketchmatch.hpp>
#include <string>
#include <vector>

#include "fake_server.hpp"

namespace sketchmatch::test {

namespace {

namespace fs = std::filesystem;

/// A variable of the environment, until the end of the block.
class Variable {
 public:
  Variable(const char* name, const std::string& value) : name_(name) {
    setenv(name, value.c_str(), 1);  // NOLINT(concurrency-mt-unsafe)
  }
  Variable(const Variable&) = delete;
  Variable& operator=(const Variable&) = delete;
  Variable(Variable&&) = delete;
  Variable& operator=(Variable&&) = delete;
  ~Variable() { unsetenv(name_); }  // NOLINT(concurrency-mt-unsafe)

 private:
  const char* name_;
};

std::string refusal(const std::string& address, const ClientOptions& options = {}) {
  try {
    const Client client(address, options);
  } catch (const InvalidRequestError& error) {
    return error.what();
  }
  return "taken";
}

fs::path written(const std::string& name, const std::string& text) {
  const auto file = fs::path(testing::TempDir()) / name;
  std::ofstream(file) << text;
  return file;
}

std::string shown_to_server(const ClientOptions& options) {
  FakeServer server;
  static_cast<void>(Client(server.address(), options).server_info());
  return server.authorizations().at(0);
}

const std::string kCertificate = "-----BEGIN CERTIFICATE-----\n-----END CERTIFICATE-----\n";

}  // namespace

TEST(Address, WhatIsNoneIsRefusedWithTheRemedy) {
  EXPECT_EQ(refusal(""), "address is ''; give host and port, as in 'localhost:50051'");
  EXPECT_EQ(refusal("a\nb:1"), "address is 'a?b:1'; give host and port, as in 'localhost:50051'");
  EXPECT_EQ(refusal("http://robot:50051"),
            "address is 'http://robot:50051'; give host and port alone, as in 'localhost:50051'");
  EXPECT_EQ(refusal("robot"), "address is 'robot'; add the port, as in 'robot:50051'");
  EXPECT_EQ(refusal("robot:99999"), "address is 'robot:99999'; give a port from 1 to 65535");
  EXPECT_EQ(refusal("robot:0"), "address is 'robot:0'; give a port from 1 to 65535");
  EXPECT_EQ(refusal("robot:abc"),
            "address is 'robot:abc'; give host and port, as in 'localhost:50051' or '[::1]:50051'");
  EXPECT_EQ(refusal("unix:"),
            "address is 'unix:'; name a file by a path of at most 107 bytes, as in "
            "'unix:/run/sketchmatch.sock'");
}

TEST(Address, WhatGrpcTakesIsTaken) {
  for (const char* address :
       {"localhost:1", "127.0.0.1:65535", "[::1]:50051", "unix:/run/sketchmatch.sock",
        "dns:robot:50051", "dns:///robot.example:50051", "ipv4:127.0.0.1:50051"}) {
    EXPECT_EQ(refusal(address), "taken") << address;
  }
  ClientOptions encrypted;
  encrypted.tls = true;
  EXPECT_EQ(refusal("robot", encrypted), "taken");  // there is a default port for TLS
}

TEST(Token, IsShownWithEveryCall) {
  ClientOptions options;
  EXPECT_EQ(shown_to_server(options), "");
  options.token = "robot-7.secret";
  EXPECT_EQ(shown_to_server(options), "Bearer robot-7.secret");
  options.token.reset();
  options.token_file = written("token", "robot-8.secret\n");
  EXPECT_EQ(shown_to_server(options), "Bearer robot-8.secret");
}

TEST(Token, TheEnvironmentSaysWhatOptionsDoNot) {
  const auto file = written("token", "robot-8.secret\n");
  const Variable by_file("SKETCHMATCH_TOKEN_FILE", file.string());
  EXPECT_EQ(shown_to_server({}), "Bearer robot-8.secret");
  const Variable token("SKETCHMATCH_TOKEN", "robot-9.secret");
  EXPECT_EQ(shown_to_server({}), "Bearer robot-9.secret");
  ClientOptions options;
  options.token_file = file;
  EXPECT_EQ(shown_to_server(options), "Bearer robot-8.secret");
  options.token_file.reset();
  options.token = "robot-7.secret";
  EXPECT_EQ(shown_to_server(options), "Bearer robot-7.secret");
  options.token = "";  // none, whatever the environment says
  EXPECT_EQ(shown_to_server(options), "");
}

TEST(Token, DoesNotLeaveThisMachineWithoutEncryption) {
  ClientOptions options;
  options.token = "robot-7.secret";
  EXPECT_EQ(refusal("robot:50051", options),
            "token would go to robot:50051 without encryption, so others could read it; "
            "give the root_certificates of the server's authority, or switch on tls");
  for (const char* here : {"localhost:1", "127.4.5.6:1", "[::1]:1", "[::ffff:127.0.0.1]:1",
                           "pad.localhost.:1", "unix:/s", "dns:///localhost:1"}) {
    EXPECT_EQ(refusal(here, options), "taken") << here;
  }
  for (const char* there : {"localhost.example:1", "128.0.0.1:1", "[2001:db8::1]:1"}) {
    EXPECT_NE(refusal(there, options), "taken") << there;
  }
  options.tls = true;
  EXPECT_EQ(refusal("robot:50051", options), "taken");
}

TEST(Token, WhatIsNoneIsRefusedAndNotTold) {
  ClientOptions options;
  options.token = "my secret";
  EXPECT_EQ(refusal("localhost:1", options),
            "token is not a token; give what `sketchmatch tokens add` printed");
  options.token_file = "x";
  EXPECT_EQ(refusal("localhost:1", options),
            "token_file cannot be used with token; drop one of the two");
  options.token.reset();
  options.token_file = "/nowhere/token";
  EXPECT_EQ(refusal("localhost:1", options),
            "token_file names /nowhere/token, which cannot be read (no such file or directory); "
            "check the path");
}

TEST(Encryption, PartsThatContradictEachOtherAreRefused) {
  ClientOptions options;
  options.certificate = Pem::content(kCertificate);
  EXPECT_EQ(refusal("localhost:1", options), "certificate is given without key; give both");
  options.tls = false;
  EXPECT_EQ(refusal("localhost:1", options), "certificate needs encryption; leave out tls = false");
  ClientOptions other;
  other.key = Pem::content("-----BEGIN PRIVATE KEY-----");
  EXPECT_EQ(refusal("localhost:1", other), "key is given without certificate; give both");
  ClientOptions own;
  own.credentials = grpc::InsecureChannelCredentials();
  EXPECT_EQ(refusal("localhost:1", own), "taken");
  own.root_certificates = Pem::content(kCertificate);
  EXPECT_EQ(refusal("localhost:1", own),
            "root_certificates cannot be used with credentials; drop one of the two");
}

TEST(Encryption, WhatIsNoPemIsRefused) {
  ClientOptions options;
  options.root_certificates = written("ca.pem", "hello");
  EXPECT_EQ(refusal("localhost:1", options),
            "root_certificates holds no certificate in PEM; give a file that begins with "
            "-----BEGIN");
  options.root_certificates = "";  // none
  EXPECT_EQ(refusal("localhost:1", options), "taken");
  const Variable key("SKETCHMATCH_KEY", written("key.pem", kCertificate).string());
  EXPECT_EQ(refusal("localhost:1"),
            "SKETCHMATCH_KEY holds no private key, without a passphrase, in PEM; give a file that "
            "begins with -----BEGIN");
}

TEST(Encryption, TheSwitchOfTheEnvironmentIsOnOrOff) {
  const Variable tls("SKETCHMATCH_TLS", "perhaps");
  EXPECT_EQ(refusal("localhost:1"), "SKETCHMATCH_TLS is 'perhaps'; give 1 or 0");
  const Variable on("SKETCHMATCH_TLS", " TRUE ");
  EXPECT_EQ(refusal("robot"), "taken");
  const Variable off("SKETCHMATCH_TLS", "0");
  EXPECT_EQ(refusal("robot"), "address is 'robot'; add the port, as in 'robot:50051'");
}

TEST(Encryption, AServerThatDoesNotEncryptIsToldFromOneThatIsAway) {
  const FakeServer server;
  ClientOptions options;
  options.tls = true;
  options.retries = 0;
  try {
    static_cast<void>(Client(server.address(), options).server_info());
    FAIL();
  } catch (const ServerUnavailableError& error) {
    EXPECT_EQ(error.remedy(), "it does not use encryption: leave out certificates and tls");
  }
}

TEST(Encryption, ACertificateThatCannotBeUsedIsToldFromAServerThatIsAway) {
  const FakeServer server;
  ClientOptions options;
  options.retries = 5;
  options.certificate = Pem::content(kCertificate);
  options.key = Pem::content("-----BEGIN PRIVATE KEY-----\n-----END PRIVATE KEY-----\n");
  const Client client(server.address(), options);
  for (const bool waiting : {false, true}) {
    try {
      waiting ? client.wait_until_serving(Seconds(60)) : static_cast<void>(client.server_info());
      FAIL();
    } catch (const InvalidRequestError& error) {
      EXPECT_EQ(error.what(),
                "the certificates for the server at " + server.address() +
                    " cannot be used; give certificate and the key that belongs to it, without a "
                    "passphrase, and root_certificates, all in PEM");
      EXPECT_EQ(error.reason(), "INVALID_FIELD");
    }
  }
}

}  // namespace sketchmatch::test
