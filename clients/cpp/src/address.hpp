/// @file
/// Addresses of servers.
#pragma once

#include <string>

namespace sketchmatch::detail {

/// Refuses what cannot be the address of a server.
/// @param address Host and port, or another address that gRPC takes.
/// @param encrypted Whether the link is encrypted; there is a default port then.
/// @throws InvalidRequestError If it is a URL, lacks a port, or names no file that can be a socket.
void check_address(const std::string& address, bool encrypted);

/// Whether an address is one of this very machine.
bool is_here(const std::string& address);

}  // namespace sketchmatch::detail
