/// @file
/// Addresses of servers.
#pragma once

#include <string>

namespace sketchmatch::detail {

/// Throws if a text cannot be the address of a server.
/// @param address Host and port, or another address that gRPC takes.
/// @param encrypted Whether the connection is encrypted; then there is a default port.
/// @throws InvalidRequestError If it is a URL, has no port, or names a file that cannot be a
/// socket.
void check_address(const std::string& address, bool encrypted);

/// Whether an address is one of this machine.
bool is_here(const std::string& address);

}  // namespace sketchmatch::detail
