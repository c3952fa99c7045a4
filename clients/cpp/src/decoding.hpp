/// @file
/// From messages to values.
#pragma once

#include <sketchmatch/v1/catalog_service.pb.h>
#include <sketchmatch/v1/match_service.pb.h>
#include <sketchmatch/v1/scene_service.pb.h>
#include <sketchmatch/v1/transfer_service.pb.h>

#include <optional>
#include <sketchmatch/catalogue.hpp>
#include <sketchmatch/match.hpp>
#include <sketchmatch/scene.hpp>
#include <sketchmatch/stored.hpp>
#include <sketchmatch/transfer.hpp>

namespace sketchmatch::detail {

/// Returns an event, or nothing for a kind that this version does not know.
std::optional<MatchEvent> decoded(const v1::MatchResponse& message);
MatchSummary decoded(const v1::MatchSummary& message);
MatchRecord decoded(const v1::GetMatchResponse& message);
Segmentation decoded(const v1::SegmentResponse& message);
StoredScene decoded(const v1::StoredScene& message);
PutScene decoded(const v1::PutSceneResponse& message);
GotScene decoded(const v1::GetSceneResponse& message);
SceneSummary decoded(const v1::SceneSummary& message);
Transfer decoded(const v1::TransferResponse& message);
Catalogue decoded(const v1::ListAlgorithmsResponse& message);
ServerInfo decoded(const v1::GetServerInfoResponse& message);

}  // namespace sketchmatch::detail
