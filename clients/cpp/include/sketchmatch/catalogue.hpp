/// @file
/// What a server offers, with its versions and limits.
#pragma once

#include <cstdint>
#include <optional>
#include <sketchmatch/match.hpp>
#include <string>
#include <vector>

namespace sketchmatch {

/// What an algorithm does in a match.
enum class AlgorithmKind { unspecified, segmenter, histogram, similarity, searcher, judge };

/// The forms of a source.
enum class SourceKind {
  unspecified,
  stroke_set,
  polygon_set,
  occupancy_grid,
  map_server_map,
  image,
  file
};

/// One algorithm that a request can name.
struct Algorithm {
  AlgorithmKind kind = AlgorithmKind::unspecified;  ///< What it does.
  std::string name;                                 ///< The name that selects it.
  std::string summary;                              ///< One line for lists.
  std::string description;                          ///< Its documentation.
  std::string distribution;                         ///< Python distribution that it comes from.
  std::string distribution_version;                 ///< Version of that distribution.
  Parameters parameters_schema;                     ///< Its parameters as a JSON Schema.
  bool is_default = false;                          ///< Whether it is used if none is named.
  std::vector<SourceKind> source_kinds;             ///< For a segmenter, what it reads.
  std::string source;                               ///< The publications that it is from.
};

/// Whether a plugin can be used.
enum class PluginState { unspecified, active, disabled, failed };

/// A distribution that offers algorithms.
struct Plugin {
  std::string distribution;                      ///< Its name.
  std::string version;                           ///< Its version.
  PluginState state = PluginState::unspecified;  ///< Whether it can be used.
  std::string reason;                            ///< Why not.
};

/// A pipeline that a request can name.
struct Profile {
  std::string name;                ///< The name that selects it.
  std::string summary;             ///< One line for lists.
  Pipeline pipeline;               ///< The algorithms that it chooses.
  bool is_default = false;         ///< Whether it is used if none is named.
  std::optional<Weights> weights;  ///< The weights of the parts of ζ.
  bool allow_unmatched = false;    ///< Whether objects may stay without partner on both sides.
};

/// Reads one kind of file.
struct FileReader {
  std::string name;                    ///< Its name in errors.
  std::string summary;                 ///< One line for lists.
  std::vector<std::string> suffixes;   ///< Endings of the names of its files.
  std::vector<std::string> json_keys;  ///< Keys by which it recognises JSON documents.
  SourceKind source_kind = SourceKind::unspecified;  ///< The form of source in such a file.
  std::string distribution;                          ///< Python distribution that it comes from.
  std::string distribution_version;                  ///< Version of that distribution.
};

/// What a server offers.
struct Catalogue {
  std::vector<Algorithm> algorithms;  ///< By kind and name.
  std::vector<Plugin> plugins;        ///< All plugins found, whether they can be used or not.
  std::vector<Profile> profiles;      ///< The pipelines that requests can name.
  std::vector<FileReader> readers;    ///< The readers of files of other tools.
};

/// Limits on requests. Where a value is absent, there is no limit.
struct ServerLimits {
  std::optional<std::uint64_t> max_request_bytes;        ///< Largest request.
  std::optional<std::uint32_t> max_objects;              ///< Most objects in a scene.
  std::optional<std::uint32_t> max_concurrent_matches;   ///< Most matches at the same time.
  std::optional<Seconds> max_time_budget;                ///< Longest time budget.
  std::optional<std::uint32_t> max_waiting;              ///< Most requests that wait.
  std::optional<Seconds> max_wait;                       ///< Longest wait.
  std::optional<Seconds> default_time_budget;            ///< The budget where none is given.
  std::optional<std::uint32_t> max_matches_per_caller;   ///< Most requests of one caller at once.
  std::optional<std::uint32_t> max_requests_per_minute;  ///< Most of one caller in a minute.
  std::optional<std::uint64_t> max_comparisons;          ///< Most comparisons of a match.
  std::optional<std::uint64_t> max_candidates;           ///< Most maps that a search evaluates.
  std::optional<std::uint64_t> max_waiting_bytes;        ///< Most bytes of waiting requests.
};

/// Versions and limits of a server.
struct ServerInfo {
  std::string version;                   ///< Version of the engine.
  std::string api_version;               ///< The newest API that it serves.
  std::uint32_t plugin_api_version = 0;  ///< Version of the plugin API.
  ServerLimits limits;                   ///< The limits on requests.
  Seconds uptime{0.0};                   ///< Time since it started.
  bool keeps_scenes = false;             ///< Whether it stores scenes.
};

}  // namespace sketchmatch
