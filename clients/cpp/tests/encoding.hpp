/// @file
/// From values back to messages: what a client lost on the way is missing in them.
#pragma once

#include <sketchmatch/raw.hpp>
#include <sketchmatch/sketchmatch.hpp>

namespace sketchmatch::test {

v1::MatchAccepted encoded(const MatchAccepted& value);
v1::MatchScenes encoded(const MatchScenes& value);
v1::MatchProgress encoded(const Progress& value);
v1::MatchResult encoded(const MatchResult& value);
v1::MatchSummary encoded(const MatchSummary& value);
v1::SegmentResponse encoded(const Segmentation& value);
v1::ListAlgorithmsResponse encoded(const Catalogue& value);
v1::GetServerInfoResponse encoded(const ServerInfo& value);

}  // namespace sketchmatch::test
