#include "address.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <string_view>

#include "text.hpp"

namespace sketchmatch::detail {

namespace {

constexpr std::array kSchemes{"dns:",   "ipv4:", "ipv6:",        "unix:",      "unix-abstract:",
                              "vsock:", "xds:",  "passthrough:", "google-c2p:"};
constexpr std::array kWithinMachine{"unix:", "unix-abstract:", "vsock:"};
constexpr std::size_t kLongestPath = 107;
constexpr std::size_t kDigits = 5;
constexpr int kMostPorts = 1 << 16;

struct Place {
  std::string host;
  std::optional<std::string> port;
};

template <std::size_t N>
bool has_scheme(const std::string& address, const std::array<const char*, N>& schemes) {
  return std::any_of(schemes.begin(), schemes.end(),
                     [&](const char* scheme) { return starts_with(address, scheme); });
}

[[noreturn]] void refuse_address(const std::string& address, const std::string& remedy) {
  refuse("address", "is " + in_quotes(address) + "; " + remedy);
}

bool is_number(std::string_view text) {
  return !text.empty() &&
         std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

/// Returns host and port, without a scheme and a name server before them.
std::optional<Place> place_of(std::string_view address) {
  if (starts_with(address, "dns://")) {
    const auto end = address.find('/', 6);
    if (end == std::string_view::npos) {
      return std::nullopt;
    }
    address.remove_prefix(end + 1);
  } else if (starts_with(address, "dns:")) {
    address.remove_prefix(4);
  } else if (starts_with(address, "ipv4:") || starts_with(address, "ipv6:")) {
    address.remove_prefix(5);
  }
  std::size_t end = address.find_first_of(":/ \t");
  if (starts_with(address, "[")) {
    end = address.find(']');
    if (end == std::string_view::npos) {
      return std::nullopt;
    }
    ++end;
  }
  Place place{std::string(address.substr(0, end)), std::nullopt};
  if (end == std::string_view::npos || end == address.size()) {
    return place;
  }
  const std::string_view rest = address.substr(end);
  if (rest.front() != ':' || !is_number(rest.substr(1))) {
    return std::nullopt;
  }
  place.port = std::string(rest.substr(1));
  return place;
}

bool is_printable(const std::string& address) {
  return is_utf8(address) && std::none_of(address.begin(), address.end(), [](char c) {
           return static_cast<unsigned char>(c) < 0x20 || c == 0x7F;
         });
}

void check_file(const std::string& address) {
  std::string_view path = address;
  path.remove_prefix(std::strlen("unix:"));
  if (starts_with(path, "//")) {
    path.remove_prefix(2);
  }
  if (path.empty() || path.size() > kLongestPath) {
    refuse_address(address, "name a file by a path of at most " + std::to_string(kLongestPath) +
                                " bytes, as in 'unix:/run/sketchmatch.sock'");
  }
}

bool is_own(in_addr number) {
  const auto value = ntohl(number.s_addr);
  return value == 0 || value >> 24U == 127;
}

/// Whether an IP address is this machine's; nothing if it is not an IP address.
std::optional<bool> is_own_number(const std::string& host) {
  in_addr v4{};
  in6_addr v6{};
  if (inet_pton(AF_INET, host.c_str(), &v4) == 1) {
    return is_own(v4);
  }
  if (inet_pton(AF_INET6, host.c_str(), &v6) != 1) {
    return std::nullopt;
  }
  if (IN6_IS_ADDR_V4MAPPED(&v6)) {                 // NOLINT: a macro of the system
    std::memcpy(&v4, &v6.s6_addr[12], sizeof v4);  // NOLINT: as the system has it
    return is_own(v4);
  }
  return IN6_IS_ADDR_LOOPBACK(&v6) || IN6_IS_ADDR_UNSPECIFIED(&v6);  // NOLINT: as above
}

}  // namespace

void check_address(const std::string& address, bool encrypted) {
  if (stripped(address).empty() || !is_printable(address)) {
    refuse_address(address, "give host and port, as in 'localhost:50051'");
  }
  if (starts_with(address, "unix:")) {
    check_file(address);
  }
  if (has_scheme(address, kSchemes)) {
    return;
  }
  if (address.find("://") != std::string::npos) {
    refuse_address(address, "give host and port alone, as in 'localhost:50051'");
  }
  const auto place = place_of(address);
  if (!place || place->host.empty()) {
    refuse_address(address, "give host and port, as in 'localhost:50051' or '[::1]:50051'");
  }
  if (!place->port) {
    if (!encrypted) {
      refuse_address(address, "add the port, as in '" + address + ":50051'");
    }
    return;
  }
  const int port = place->port->size() > kDigits ? 0 : std::stoi(*place->port);
  if (port < 1 || port >= kMostPorts) {
    refuse_address(address, "give a port from 1 to 65535");
  }
}

bool is_here(const std::string& address) {
  if (has_scheme(address, kWithinMachine)) {
    return true;
  }
  const auto place = place_of(address);
  std::string host = place ? lowered(place->host) : std::string();
  if (starts_with(host, "[")) {
    host = host.substr(1, host.size() - 2);
  }
  if (!host.empty() && host.back() == '.') {
    host.pop_back();
  }
  if (const auto own = is_own_number(host)) {
    return *own;
  }
  constexpr std::array kNames{"localhost", "localhost.localdomain", "ip6-localhost",
                              "ip6-loopback"};
  constexpr std::string_view kEnd = ".localhost";
  return std::find(kNames.begin(), kNames.end(), host) != kNames.end() ||
         (host.size() > kEnd.size() && host.substr(host.size() - kEnd.size()) == kEnd);
}

}  // namespace sketchmatch::detail
