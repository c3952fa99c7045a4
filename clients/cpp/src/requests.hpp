/// @file
/// From options to requests.
#pragma once

#include <sketchmatch/v1/match_service.pb.h>
#include <sketchmatch/v1/scene_service.pb.h>

#include <sketchmatch/options.hpp>
#include <sketchmatch/sources.hpp>

namespace sketchmatch::detail {

/// Returns the request for a match.
/// @throws InvalidRequestError If an option has no place in a message.
v1::MatchRequest match_request(const Source& sketch, const Source& map,
                               const MatchOptions& options);

/// Returns the request for the objects of one source.
/// @throws InvalidRequestError As `match_request`.
v1::SegmentRequest segment_request(const Source& source, const SegmentOptions& options);

}  // namespace sketchmatch::detail
