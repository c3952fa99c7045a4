/// @file
/// How a client connects: encryption, certificates and tokens, from options or the environment.
#pragma once

#include <grpcpp/security/credentials.h>

#include <memory>
#include <optional>
#include <sketchmatch/options.hpp>
#include <string>

namespace sketchmatch::detail {

/// Credentials of a channel and of its calls.
struct Access {
  std::shared_ptr<grpc::ChannelCredentials> credentials;
  std::optional<std::string> server_name;
  std::string authorization;  // empty without a token
};

/// Returns the credentials for an address.
/// @throws InvalidRequestError If the address is invalid, a file cannot be read, options contradict
///   each other, or others could read the token.
Access access_to(const std::string& address, const ClientOptions& options);

}  // namespace sketchmatch::detail
