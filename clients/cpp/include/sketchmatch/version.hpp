/// @file
/// Version of the client.
#pragma once

namespace sketchmatch {

/// Version of this package.
inline constexpr const char* kVersion = "0.1.0";

}  // namespace sketchmatch
