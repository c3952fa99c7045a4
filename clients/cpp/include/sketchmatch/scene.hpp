/// @file
/// Scenes: the objects that segmenters find in sketches and maps.
#pragma once

#include <cstdint>
#include <optional>
#include <sketchmatch/value.hpp>
#include <string>
#include <vector>

namespace sketchmatch {

/// A point of the plane.
struct Point {
  double x = 0.0;  ///< To the right: in metres for a map, in any unit for a sketch.
  double y = 0.0;  ///< Upwards, or by the `YAxis` of the source that the point is part of.
};

/// A closed line that does not cross itself; the last corner need not repeat the first.
using Ring = std::vector<Point>;

/// One object of a scene: a polygon that may have holes.
struct SceneObject {
  std::vector<Ring> rings;          ///< The outline counter-clockwise, then the holes clockwise.
  std::string label;                ///< A name for people; empty if the source gave none.
  double area = 0.0;                ///< Without the holes, in squared units of the scene.
  Point centroid;                   ///< Centre of that area; it may lie outside a concave object.
  std::optional<double> certainty;  ///< That it is one thing; nothing if it is certain.
};

/// The objects that a segmenter found, with x to the right and y up. Their indices count from 0.
struct Scene {
  std::vector<SceneObject> objects;  ///< The objects.
};

/// An algorithm and its parameters.
struct AlgorithmSelection {
  std::string name;       ///< Name of the algorithm.
  Parameters parameters;  ///< The value of every parameter.
};

/// A passage between two objects, such as rooms.
struct Passage {
  std::uint32_t first = 0;   ///< Index of one of them.
  std::uint32_t second = 0;  ///< Index of the other one.
};

/// A robot's map as map_server saves it.
struct MapServerMap {
  std::string yaml;          ///< Text of the YAML file.
  std::string image;         ///< Bytes of the picture.
  std::string objects;       ///< Text of the file with its corrected objects; may be empty.
  bool own_objects = false;  ///< Whether they are for this map even if they do not say so.
};

/// What a segmenter found in one source.
struct Segmentation {
  Scene scene;                        ///< The objects.
  std::vector<std::string> warnings;  ///< Sentences about what it left out or decided.
  AlgorithmSelection segmenter;       ///< The segmenter with the parameters it ran with.
  std::vector<Point> route;           ///< The route that the person drew through the scene.
  std::vector<Passage> passages;      ///< Passages between objects, such as rooms.
  std::optional<MapServerMap> map;    ///< The occupancy grid, if requested and present.
};

}  // namespace sketchmatch
