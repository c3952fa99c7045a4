/// @file
/// Scenes: what segmenters make of sketches and maps.
#pragma once

#include <cstdint>
#include <optional>
#include <sketchmatch/value.hpp>
#include <string>
#include <vector>

namespace sketchmatch {

/// A point of the plane.
struct Point {
  double x = 0.0;  ///< To the right: metres for a map, units of its own for a sketch.
  double y = 0.0;  ///< Upwards, or by the `YAxis` of the source that the point is part of.
};

/// A closed line that does not cross itself; the last corner need not repeat the first.
using Ring = std::vector<Point>;

/// One object of a scene: a polygon, perhaps with holes.
struct SceneObject {
  std::vector<Ring> rings;          ///< The outline counter-clockwise, then the holes clockwise.
  std::string label;                ///< A name for people; empty if the source gave none.
  double area = 0.0;                ///< Without the holes, in squared units of the scene.
  Point centroid;                   ///< Centre of that area; it may lie outside a concave object.
  std::optional<double> certainty;  ///< How sure it is one thing; none where it is sure.
};

/// The objects that a segmenter found, x to the right and y up; their order is their index.
struct Scene {
  std::vector<SceneObject> objects;  ///< The objects.
};

/// An algorithm and its parameters.
struct AlgorithmSelection {
  std::string name;       ///< Name of the algorithm.
  Parameters parameters;  ///< The value of every parameter.
};

/// Two objects that open into each other, as rooms do.
struct Passage {
  std::uint32_t first = 0;   ///< One of them, by its index.
  std::uint32_t second = 0;  ///< The other one.
};

/// A robot's map as map_server saves it.
struct MapServerMap {
  std::string yaml;          ///< Text of the YAML file.
  std::string image;         ///< Bytes of the picture.
  std::string objects;       ///< Text of the file that says what its objects are; may be empty.
  bool own_objects = false;  ///< Whether these are of this map though they do not say so.
};

/// What a segmenter found in one source.
struct Segmentation {
  Scene scene;                        ///< The objects.
  std::vector<std::string> warnings;  ///< What it left out or decided on its own, in sentences.
  AlgorithmSelection segmenter;       ///< The segmenter as it ran.
  std::vector<Point> route;           ///< The way that the person drew through the scene.
  std::vector<Passage> passages;      ///< Which objects open into each other: rooms do.
  std::optional<MapServerMap> map;  ///< The occupancy grid, where it is asked for and there is one.
};

}  // namespace sketchmatch
