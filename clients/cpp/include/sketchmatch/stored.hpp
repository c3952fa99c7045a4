/// @file
/// Scenes that a server keeps, for later matches.
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

/// A scene that the server keeps; `sources::stored_scene` takes its name.
struct StoredScene {
  std::string name;                   ///< The hash of what it is: 64 digits.
  Scene scene;                        ///< The objects.
  std::vector<std::string> warnings;  ///< As in `Segmentation`.
  AlgorithmSelection segmenter;       ///< The segmenter that found the objects, as it ran.
  std::vector<Point> route;           ///< As in `Segmentation`.
  std::string title;                  ///< What you call it; empty if nothing.
  std::vector<Passage> passages;      ///< As in `Segmentation`.
};

/// How to find the objects of a scene that is put, and what to call it.
struct PutOptions : SegmentOptions {
  /// For people who choose among scenes: up to 200 characters, and no part of the scene's name.
  /// Left out: a scene that you have put already keeps its title.
  std::string title;
};

/// What came of `Client::put_scene`.
struct PutScene {
  StoredScene stored_scene;  ///< The scene that is kept.
  bool created = false;      ///< Whether the caller had not put it before.
};

/// What `Client::get_scene` found.
struct GotScene {
  StoredScene stored_scene;      ///< The scene.
  std::optional<Source> source;  ///< What it was found in, where that was wanted.
};

/// What a list tells of a scene.
struct SceneSummary {
  using Time = std::chrono::system_clock::time_point;  ///< A moment.

  std::string name;                 ///< Its name.
  std::uint32_t object_count = 0;   ///< How many objects it has.
  std::vector<std::string> labels;  ///< Those of its objects that have one, in their order.
  Time put_time;                    ///< When the caller put it, or gave it its labels.
  std::string title;                ///< What you call it; empty if nothing.
};

/// Labels of objects by their index, from 0.
using ObjectLabels = std::map<std::uint32_t, std::string>;

}  // namespace sketchmatch
