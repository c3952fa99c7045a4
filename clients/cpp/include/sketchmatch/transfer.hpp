/// @file
/// Points, routes and zones, and what becomes of them on the way from one scene to another.
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

/// A way that is driven in the order of its points.
struct Route {
  std::vector<Point> points;                     ///< Its points, two or more.
  std::vector<double> speeds_meters_per_second;  ///< From each of its points on; or none at all.
};

/// An area.
struct Zone {
  std::vector<Ring> rings;  ///< Its outline, then its holes, if any.
};

/// Something at a place, with a name: `{"dock", Point{1.0, 2.0}}`.
struct Feature {
  std::string name;                                       ///< A name for people.
  std::variant<std::monostate, Point, Route, Zone> kind;  ///< What it is; in an answer nothing
                                                          ///< where none of it can be reached.
};

/// From where to where features are carried.
enum class TransferDirection {
  unspecified,    ///< As `sketch_to_map`.
  sketch_to_map,  ///< From the sketch to the map, or from the old map to the new one.
  map_to_sketch   ///< From the map to the sketch.
};

/// How to carry features; whatever is left out is the server's to decide.
///
/// What is about a match that has a name is for matches alone, and refused: `alternatives`,
/// `request_id`, `keep_running` and `priority`.
struct TransferOptions : MatchOptions {
  /// Which sketched object is which mapped one, where that is known, as `Match::object_map` says:
  /// then nothing is matched. Two pairs or more.
  ObjectMap object_map;
  /// From where to where.
  TransferDirection direction = TransferDirection::unspecified;
  /// Which way y grows in the features; in the answer it grows upwards.
  YAxis y_axis = YAxis::up;
  /// How far routes are kept away from obstacles: half the width of the robot. Left out: 0 on a
  /// grid; elsewhere routes are not kept out of objects then.
  std::optional<double> radius;
  /// Whether cells that nobody has seen are no obstacles.
  bool allow_unknown = false;
};

/// Why something was changed, or could not be had.
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

/// What was changed about a feature, or could not be had.
struct FeatureChange {
  ChangeReason reason = ChangeReason::unspecified;  ///< Of which kind it is.
  std::uint32_t first_point = 0;                    ///< The first of the carried points.
  std::uint32_t last_point = 0;                     ///< The last of them.
  std::string sentence;                             ///< What was done and why, for people.
};

/// What is to be known of a line of carried points, beside where they are.
struct CarriedPoints {
  std::vector<double> deviations;  ///< Standard deviation of each, along each axis.
  std::vector<double> sources;     ///< Which given point each is, by index, or between which two.
};

/// A feature where it was carried to.
struct CarriedFeature {
  Feature feature;                     ///< What it is there, y upwards.
  std::vector<CarriedPoints> lines;    ///< For the point or route as one, or the rings of a zone.
  std::vector<FeatureChange> changes;  ///< What was changed, in the order of the points.
  bool drawn = false;                  ///< Whether it is the route that was found in the sketch.
};

/// What a warp may do beside turning, scaling and shifting the whole.
enum class WarpKind { unspecified, similarity, affine, spline };

/// The warp that carried the features.
struct Warp {
  WarpKind kind = WarpKind::unspecified;  ///< What it may do.
  double rotation_radians = 0.0;          ///< Counter-clockwise, by which it turns the whole.
  double scale = 0.0;                     ///< By which it enlarges the whole.
  double residual = 0.0;                  ///< Root mean square of what the objects miss by.
  std::vector<double> weights;            ///< What each of `Transfer::partners` counts for.
};

/// Two objects that are the same.
struct Partners {
  std::uint32_t sketch_object = 0;  ///< Index in the sketch, from 0.
  std::uint32_t map_object = 0;     ///< Index in the map, from 0.
};

/// The features where they were carried to.
struct Transfer {
  std::vector<CarriedFeature> features;  ///< The route found in the sketch, then those given.
  Warp warp;                             ///< How they were carried.
  std::vector<Partners> partners;        ///< Which object is which, as it was given or matched.
  MatchScenes scenes;                    ///< The objects that were found on both sides.
  std::optional<MatchResult> match;      ///< The match; none where the object map was given.

  /// For each sketched object with a partner the index of its mapped object, from 0.
  [[nodiscard]] ObjectMap object_map() const;
};

}  // namespace sketchmatch
