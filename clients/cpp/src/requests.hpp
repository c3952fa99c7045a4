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
/// @throws InvalidRequestError If an option does not fit its field.
v1::MatchRequest match_request(const Source& sketch, const Source& map,
                               const MatchOptions& options);

/// Returns the request for the objects of one source.
/// @throws InvalidRequestError As `match_request`.
v1::SegmentRequest segment_request(const Source& source, const SegmentOptions& options);

/// Returns the request to store a scene.
/// @throws InvalidRequestError As `match_request`.
v1::PutSceneRequest put_scene_request(const Source& source, const PutOptions& options);

/// Returns the request for other labels of a scene, or another title.
/// @throws InvalidRequestError If a text is not UTF-8.
v1::UpdateSceneRequest update_scene_request(const std::string& name, const ObjectLabels& labels,
                                            const std::optional<std::string>& title);

/// Returns the request to transfer features.
/// @throws InvalidRequestError If an option does not fit its field or is only for matches, or if a
///   feature is empty.
v1::TransferRequest transfer_request(const Source& sketch, const Source& map,
                                     const std::vector<Feature>& features,
                                     const TransferOptions& options);

}  // namespace sketchmatch::detail
