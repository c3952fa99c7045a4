/// @file
/// Matches: what a server answers, event by event and as a whole.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <sketchmatch/errors.hpp>
#include <sketchmatch/options.hpp>
#include <sketchmatch/scene.hpp>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace sketchmatch {

/// From the index of a sketched object to that of the mapped one, both from 0.
using ObjectMap = std::map<std::uint32_t, std::uint32_t>;

/// The algorithm of every stage of a match.
struct Pipeline {
  AlgorithmSelection sketch_segmenter;  ///< Finds the objects in the sketch.
  AlgorithmSelection map_segmenter;     ///< Finds the objects in the map.
  AlgorithmSelection histogram;         ///< Describes how two objects lie to each other.
  AlgorithmSelection similarity;        ///< Says how alike two such relations are.
  AlgorithmSelection searcher;          ///< Looks for the best map.
  AlgorithmSelection judge;             ///< Says which of the maps found is the answer.
  std::string profile;                  ///< Name of the profile that decided the rest.
};

/// The request runs, and how.
struct MatchAccepted {
  std::string match_id;                   ///< Name of the match; it stands in the server's log.
  std::uint64_t seed = 0;                 ///< The seed in force.
  Pipeline pipeline;                      ///< Every algorithm with every parameter.
  Weights weights;                        ///< The weights in force.
  std::optional<Seconds> time_budget;     ///< The time budget in force, if there is one.
  std::optional<double> unmatched_price;  ///< The price in force for unmatched objects, if any.
  std::optional<bool> allow_unmatched;    ///< Whether objects may stay without partner.
};

/// The objects found, which the indices of later events point to.
struct MatchScenes {
  Scene sketch;                              ///< Those of the sketch.
  Scene map;                                 ///< Those of the map.
  std::vector<std::string> sketch_warnings;  ///< What was left out of the sketch, in sentences.
  std::vector<std::string> map_warnings;     ///< The same for the map.
  std::vector<Point> sketch_route;           ///< The way that the person drew through the sketch.
};

/// How a sketched object lies to another, as the person drew it.
struct ObjectRelation {
  std::uint32_t reference_object = 0;  ///< The sketched object that it is seen from.
  std::string phrase;                  ///< E.g. "to the left of and below".
  double degree = 0.0;                 ///< How well the phrase fits; below 0.3 none is clear.
};

/// One line of an object map: this sketched object is that mapped one.
struct ObjectMatch {
  std::uint32_t sketch_object = 0;         ///< Index in the sketch, from 0.
  std::uint32_t map_object = 0;            ///< Index in the map, from 0.
  std::string sketch_label;                ///< Label of the sketched object; may be empty.
  std::string map_label;                   ///< Label of the mapped object; may be empty.
  double confidence = 0.0;                 ///< How much of the evidence speaks for it.
  std::optional<double> margin;            ///< By how much ζ falls with its best other partner.
  std::optional<ObjectRelation> relation;  ///< How it lies to its nearest neighbour.
  std::optional<double> probability;       ///< How likely the line is right.
};

/// What is being done.
enum class Phase { unspecified, segment, describe, relate, search, compile };

/// How far a match is.
struct Progress {
  Phase phase = Phase::unspecified;         ///< What is being done.
  std::optional<double> fraction;           ///< How much of it is done, where that is known.
  std::uint64_t iteration = 0;              ///< Iterations of the search so far.
  std::uint64_t evaluations = 0;            ///< Maps that it has evaluated so far.
  std::optional<double> confidence;         ///< ζ of the best map so far; it never falls.
  std::optional<double> upper_bound;        ///< A ζ that no map exceeds, where one is proven.
  std::vector<ObjectMatch> object_matches;  ///< The best object map so far.
  Seconds elapsed{0.0};                     ///< Since the request was accepted.

  /// The best object map so far.
  [[nodiscard]] ObjectMap object_map() const;
};

/// Why a search ended; each comes with an answer.
enum class Outcome {
  unspecified,
  converged,
  optimal,
  time_budget,
  iteration_limit,
  server_stopping
};

/// ζ of a map, and its parts.
struct FmapConfidence {
  double total = 0.0;           ///< ζ.
  double similarity = 0.0;      ///< How alike the relations are.
  double rotation = 0.0;        ///< How well their rotations agree.
  double dilation = 0.0;        ///< How well their dilations agree.
  std::optional<double> shape;  ///< How alike in shape the objects are.
  std::optional<double> size;   ///< How well their sizes agree.
};

/// Two objects of one scene: the one described, and the one that it is seen from.
using ObjectPair = std::pair<std::uint32_t, std::uint32_t>;

/// Two sketched objects lie to each other as two mapped ones do.
struct FmapEntry {
  ObjectPair sketch_pair;         ///< The two sketched objects.
  ObjectPair map_pair;            ///< The two mapped ones.
  double similarity = 0.0;        ///< How alike the two relations are.
  double rotation_radians = 0.0;  ///< Counter-clockwise from sketch to map.
  double dilation = 0.0;          ///< Factor from the size in the sketch to that in the map.
};

/// An object map that is not the best.
struct AlternativeMap {
  std::vector<ObjectMatch> object_matches;  ///< Its lines.
  FmapConfidence fmap_confidence;           ///< Its ζ.
  double omap_confidence = 0.0;             ///< Its Ω.
  std::optional<double> probability;        ///< How likely it is right.
};

/// Several maps that are about equally likely, as in a symmetric room.
struct Ambiguity {
  std::uint32_t maps = 0;                              ///< How many, the best among them.
  std::vector<std::uint32_t> alternatives;             ///< Which alternatives are among them.
  std::vector<std::uint32_t> deciding_sketch_objects;  ///< Ask who the first of them is.
};

/// Several objects of one side, or of both, that are one place on the other.
struct ObjectGroup {
  std::vector<std::uint32_t> sketch_objects;  ///< Indices in the sketch.
  std::vector<std::uint32_t> map_objects;     ///< Indices in the map.
  std::optional<double> probability;          ///< How likely they belong together.
};

/// What a match cost.
struct MatchStatistics {
  std::uint64_t iterations = 0;   ///< Of the search.
  std::uint64_t evaluations = 0;  ///< Maps evaluated.
  Seconds segment_elapsed{0.0};   ///< For finding the objects.
  Seconds describe_elapsed{0.0};  ///< For describing their relations.
  Seconds relate_elapsed{0.0};    ///< For comparing them.
  Seconds search_elapsed{0.0};    ///< For the search.
  Seconds total_elapsed{0.0};     ///< From the acceptance to the result.
};

/// The answer.
struct MatchResult {
  std::string match_id;                                 ///< Name of the match.
  std::uint64_t seed = 0;                               ///< The seed it ran with.
  Outcome outcome = Outcome::unspecified;               ///< Why the search ended.
  std::vector<ObjectMatch> object_matches;              ///< The object map, line by line.
  std::vector<std::uint32_t> unmatched_sketch_objects;  ///< Sketched objects without partner.
  std::vector<double> unmatched_sketch_probabilities;   ///< How likely each of them has none.
  std::vector<std::uint32_t> unmatched_map_objects;     ///< Mapped objects without partner.
  double omap_confidence = 0.0;                         ///< Ω, the mean confidence of the lines.
  FmapConfidence fmap_confidence;                       ///< ζ and its parts.
  std::optional<double> upper_bound;                    ///< A ζ that no map exceeds, if proven.
  std::vector<FmapEntry> fmap_entries;                  ///< What the object map follows from.
  double rotation_radians = 0.0;                        ///< By which the sketch is turned.
  double scale = 0.0;                                   ///< By which the sketch grows.
  MatchStatistics statistics;                           ///< What it cost.
  std::vector<AlternativeMap> alternatives;             ///< The next best object maps.
  std::string search_note;                              ///< What the searcher has to say.
  std::optional<double> probability;                    ///< How likely the map is right, whole.
  std::optional<double> place_probability;              ///< How likely it is this place at all.
  std::optional<Ambiguity> ambiguity;                   ///< Which maps are about as likely.
  bool provisional = false;                             ///< Whether the sketch goes on.
  std::vector<ObjectGroup> object_groups;               ///< What is several on one side.
};

/// A finished match. Written to a stream it is a small table.
struct Match {
  MatchAccepted accepted;  ///< How it ran.
  MatchScenes scenes;      ///< The objects that the indices of the result point to.
  MatchResult result;      ///< The answer.

  /// For each sketched object with a partner the index of its mapped object, from 0.
  [[nodiscard]] ObjectMap object_map() const;
};

/// An event of a match.
using MatchEvent = std::variant<MatchAccepted, MatchScenes, Progress, MatchResult>;

/// An event, and its place in the match.
struct NumberedEvent {
  std::uint64_t number = 0;  ///< From 1, and larger from one event of a match to the next.
  MatchEvent event;          ///< The event.
};

/// Where a match is in its life: queued, running, perhaps cancelling, and then one of the others.
enum class MatchState {
  unspecified,
  queued,
  running,
  cancelling,
  succeeded,
  failed,
  cancelled,
  interrupted
};

/// What is known of a match that has a name.
struct MatchSummary {
  using Time = std::chrono::system_clock::time_point;  ///< A moment.

  std::string match_id;                        ///< Its name.
  std::string request_id;                      ///< `MatchOptions::request_id`.
  MatchState state = MatchState::unspecified;  ///< Where it is in its life.
  Time created_at;                             ///< When it was asked for.
  std::optional<Time> ended_at;                ///< When it ended; none until then.
  Outcome outcome = Outcome::unspecified;      ///< Why its search ended, if it succeeded.
  std::uint64_t last_event = 0;                ///< The number of its latest event; 0 for none.
  std::string error_message;                   ///< What it ended with, if it did not succeed.
  std::string error_reason;                    ///< The same for programs.
};

/// How a match is, and what came of it.
struct MatchRecord {
  MatchSummary match;                 ///< What is known of it.
  std::vector<NumberedEvent> events;  ///< Its events so far; of progress the latest alone.
};

/// Called with each progress, at most 20 a second. What it throws ends the match.
using ProgressCallback = std::function<void(const Progress&)>;

}  // namespace sketchmatch
