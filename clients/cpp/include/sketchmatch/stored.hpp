/// @file
/// Scenes that are stored on a server for later matches.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <sketchmatch/options.hpp>
#include <sketchmatch/scene.hpp>
#include <sketchmatch/sources.hpp>
#include <string>
#include <vector>

namespace sketchmatch {

/// A scene that is stored on the server; pass its name to `sources::stored_scene`.
struct StoredScene {
  std::string name;                   ///< The hash of its content: 64 digits.
  Scene scene;                        ///< The objects.
  std::vector<std::string> warnings;  ///< As in `Segmentation`.
  AlgorithmSelection segmenter;       ///< The segmenter with the parameters it ran with.
  std::vector<Point> route;           ///< As in `Segmentation`.
  std::string title;                  ///< Its title; may be empty.
  std::vector<Passage> passages;      ///< As in `Segmentation`.
};

/// How to find the objects of a scene that is to be stored, and its title.
struct PutOptions : SegmentOptions {
  /// A title for people, up to 200 characters. It does not change the scene's name. If left out, a
  /// scene that this caller has already stored keeps its title.
  std::string title;
};

/// The result of `Client::put_scene`.
struct PutScene {
  StoredScene stored_scene;  ///< The stored scene.
  bool created = false;      ///< Whether the caller had not stored it before.
};

/// The result of `Client::get_scene`.
struct GotScene {
  StoredScene stored_scene;      ///< The scene.
  std::optional<Source> source;  ///< The source of its objects, if requested.
};

/// A scene in a list.
struct SceneSummary {
  using Time = std::chrono::system_clock::time_point;  ///< A moment.

  std::string name;                 ///< Its name.
  std::uint32_t object_count = 0;   ///< How many objects it has.
  std::vector<std::string> labels;  ///< Labels of the objects that have one, in their order.
  Time put_time;                    ///< When the caller stored it or gave it its labels.
  std::string title;                ///< Its title; may be empty.
};

/// Labels of objects by their index, from 0.
using ObjectLabels = std::map<std::uint32_t, std::string>;

}  // namespace sketchmatch
