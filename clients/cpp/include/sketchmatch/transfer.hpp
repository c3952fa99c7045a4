/// @file
/// Points, routes and zones, and their transfer from one scene to another.
#pragma once

#include <cstdint>
#include <optional>
#include <sketchmatch/match.hpp>
#include <sketchmatch/options.hpp>
#include <sketchmatch/scene.hpp>
#include <sketchmatch/sources.hpp>
#include <string>
#include <variant>
#include <vector>

namespace sketchmatch {

/// A route that is driven in the order of its points.
struct Route {
  std::vector<Point> points;                     ///< Its points, two or more.
  std::vector<double> speeds_meters_per_second;  ///< The speed from each point on, or empty.
};

/// An area.
struct Zone {
  std::vector<Ring> rings;  ///< Its outline, then its holes, if any.
};

/// Something at a place, with a name: `{"dock", Point{1.0, 2.0}}`.
struct Feature {
  std::string name;                                       ///< A name for people.
  std::variant<std::monostate, Point, Route, Zone> kind;  ///< What it is; in an answer empty if
                                                          ///< none of it can be reached.
};

/// The direction in which features are transferred.
enum class TransferDirection {
  unspecified,    ///< As `sketch_to_map`.
  sketch_to_map,  ///< From the sketch to the map, or from the old map to the new one.
  map_to_sketch   ///< From the map to the sketch.
};

/// How to transfer features. For what is left out, the server has defaults.
///
/// `alternatives`, `request_id`, `keep_running` and `priority` are only for matches, and are
/// refused here.
struct TransferOptions : MatchOptions {
  /// Which sketched object is which mapped one, if that is known, such as `Match::object_map`; two
  /// pairs or more. Nothing is matched then.
  ObjectMap object_map;
  /// The direction of the transfer.
  TransferDirection direction = TransferDirection::unspecified;
  /// Which way y grows in the given features; in the answer it always grows upwards.
  YAxis y_axis = YAxis::up;
  /// Distance of routes from obstacles: half the width of the robot. By default 0 on a grid; on
  /// other maps routes may then cross objects.
  std::optional<double> radius;
  /// Whether routes may cross unknown cells.
  bool allow_unknown = false;
};

/// Why a feature was changed, or could not be transferred.
enum class ChangeReason {
  unspecified,
  obstacle,
  moved_start,
  moved_end,
  other_side,
  unreachable,
  blocked,
  outside
};

/// A change of a feature, or why it could not be transferred.
struct FeatureChange {
  ChangeReason reason = ChangeReason::unspecified;  ///< The kind of the change.
  std::uint32_t first_point = 0;                    ///< The first of the carried points.
  std::uint32_t last_point = 0;                     ///< The last of them.
  std::string sentence;                             ///< What was done and why, for people.
};

/// The accuracy of a line of transferred points, and where they come from.
struct CarriedPoints {
  std::vector<double> deviations;  ///< Standard deviation of each, along each axis.
  std::vector<double> sources;     ///< Index of the given point of each, or a fraction between two.
};

/// A transferred feature.
struct CarriedFeature {
  Feature feature;                   ///< The feature in the other scene, with y upwards.
  std::vector<CarriedPoints> lines;  ///< One for a point or route, or one for each ring of a zone.
  std::vector<FeatureChange> changes;  ///< What was changed, in the order of the points.
  bool drawn = false;                  ///< Whether it is the route that was found in the sketch.
};

/// What a warp may do beyond rotating, scaling and shifting everything.
enum class WarpKind { unspecified, similarity, affine, spline };

/// The warp that carried the features.
struct Warp {
  WarpKind kind = WarpKind::unspecified;  ///< The kind of warp.
  double rotation_radians = 0.0;          ///< Its rotation, counter-clockwise.
  double scale = 0.0;                     ///< The factor by which it enlarges.
  double residual = 0.0;                  ///< Root mean square of how far objects are off.
  std::vector<double> weights;            ///< The weight of each of `Transfer::partners`.
};

/// A sketched and a mapped object that are the same.
struct Partners {
  std::uint32_t sketch_object = 0;  ///< Index in the sketch, from 0.
  std::uint32_t map_object = 0;     ///< Index in the map, from 0.
};

/// The answer of a transfer.
struct Transfer {
  std::vector<CarriedFeature> features;  ///< The route found in the sketch, then those given.
  Warp warp;                             ///< The warp that carried them.
  std::vector<Partners> partners;        ///< Which object is which, as given or matched.
  MatchScenes scenes;                    ///< The objects that were found in both scenes.
  std::optional<MatchResult> match;      ///< The match, unless the object map was given.

  /// For each sketched object with a partner the index of its mapped object, from 0.
  [[nodiscard]] ObjectMap object_map() const;
};

}  // namespace sketchmatch
