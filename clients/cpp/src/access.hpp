/// @file
/// How a client gets in: encryption, certificates and tokens, from options or the environment.
#pragma once

#include <grpcpp/security/credentials.h>

#include <memory>
#include <optional>
#include <sketchmatch/options.hpp>
#include <string>

namespace sketchmatch::detail {

/// What a channel and its calls need to be let in.
struct Access {
  std::shared_ptr<grpc::ChannelCredentials> credentials;
  std::optional<std::string> server_name;
  std::string authorization;  // empty without a token
};

/// Returns how to get in at an address.
/// @throws InvalidRequestError If the address is none, a file cannot be read, parts contradict each
///   other, or others could read the token.
Access access_to(const std::string& address, const ClientOptions& options);

}  // namespace sketchmatch::detail
