/// @file
/// From options to requests.
#pragma once

#include <sketchmatch/v1/match_service.pb.h>
#include <sketchmatch/v1/scene_service.pb.h>
#include <sketchmatch/v1/transfer_service.pb.h>

#include <optional>
#include <sketchmatch/options.hpp>
#include <sketchmatch/sources.hpp>
#include <sketchmatch/stored.hpp>
#include <sketchmatch/transfer.hpp>
#include <string>
#include <vector>

namespace sketchmatch::detail {

/// Returns the request for a match.
/// @throws InvalidRequestError If an option has no place in a message.
v1::MatchRequest match_request(const Source& sketch, const Source& map,
                               const MatchOptions& options);

/// Returns the request for the objects of one source.
/// @throws InvalidRequestError As `match_request`.
v1::SegmentRequest segment_request(const Source& source, const SegmentOptions& options);

/// Returns the request to keep a scene.
/// @throws InvalidRequestError As `match_request`.
v1::PutSceneRequest put_scene_request(const Source& source, const PutOptions& options);

/// Returns the request for other labels of a scene, or another title.
/// @throws InvalidRequestError If a text is no UTF-8.
v1::UpdateSceneRequest update_scene_request(const std::string& name, const ObjectLabels& labels,
                                            const std::optional<std::string>& title);

/// Returns the request to carry features.
/// @throws InvalidRequestError If an option has no place in a message, or is for matches alone; or
///   a feature is nothing.
v1::TransferRequest transfer_request(const Source& sketch, const Source& map,
                                     const std::vector<Feature>& features,
                                     const TransferOptions& options);

}  // namespace sketchmatch::detail
