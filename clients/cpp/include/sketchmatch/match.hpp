/// @file
/// Matches: the answers of a server, event by event and as a whole.
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

/// From the index of a sketched object to that of its mapped object; both count from 0.
using ObjectMap = std::map<std::uint32_t, std::uint32_t>;

/// The algorithm of every stage of a match.
struct Pipeline {
  AlgorithmSelection sketch_segmenter;  ///< Finds the objects in the sketch.
  AlgorithmSelection map_segmenter;     ///< Finds the objects in the map.
  AlgorithmSelection histogram;         ///< Describes the relation of two objects.
  AlgorithmSelection similarity;        ///< Compares two relations.
  AlgorithmSelection searcher;          ///< Searches for the best object map.
  AlgorithmSelection judge;             ///< Decides which object map is the answer.
  std::string profile;                  ///< Name of the profile that was used.
};

/// The first event: the request was accepted, with these settings.
struct MatchAccepted {
  std::string match_id;                   ///< Name of the match, also in the server's log.
  std::uint64_t seed = 0;                 ///< The seed that is used.
  Pipeline pipeline;                      ///< Every algorithm with every parameter.
  Weights weights;                        ///< The weights that are used.
  std::optional<Seconds> time_budget;     ///< The time budget, if there is one.
  std::optional<double> unmatched_price;  ///< The price of unmatched objects, if any.
  std::optional<bool> allow_unmatched;    ///< Whether objects may stay without partner.
};

/// The objects that were found; indices of later events refer to them.
struct MatchScenes {
  Scene sketch;                              ///< The objects of the sketch.
  Scene map;                                 ///< The objects of the map.
  std::vector<std::string> sketch_warnings;  ///< Sentences about what was left out of the sketch.
  std::vector<std::string> map_warnings;     ///< The same for the map.
  std::vector<Point> sketch_route;           ///< The route that the person drew in the sketch.
};

/// The relation of a sketched object to another one, as the person drew them.
struct ObjectRelation {
  std::uint32_t reference_object = 0;  ///< The object from which it is seen.
  std::string phrase;                  ///< E.g. "to the left of and below".
  double degree = 0.0;  ///< How well the phrase fits; below 0.3, no direction is clear.
};

/// One line of an object map: this sketched object is that mapped one.
struct ObjectMatch {
  std::uint32_t sketch_object = 0;         ///< Index in the sketch, from 0.
  std::uint32_t map_object = 0;            ///< Index in the map, from 0.
  std::string sketch_label;                ///< Label of the sketched object; may be empty.
  std::string map_label;                   ///< Label of the mapped object; may be empty.
  double confidence = 0.0;                 ///< How well the relations support this line.
  std::optional<double> margin;            ///< How much ζ falls with the next best partner.
  std::optional<ObjectRelation> relation;  ///< The relation to its nearest neighbour.
  std::optional<double> probability;       ///< How likely this line is right.
};

/// The phase of a match.
enum class Phase { unspecified, segment, describe, relate, search, compile };

/// The progress of a match.
struct Progress {
  Phase phase = Phase::unspecified;         ///< The current phase.
  std::optional<double> fraction;           ///< The share of it that is done, if known.
  std::uint64_t iteration = 0;              ///< Iterations of the search so far.
  std::uint64_t evaluations = 0;            ///< Object maps evaluated so far.
  std::optional<double> confidence;         ///< ζ of the best map so far; it never falls.
  std::optional<double> upper_bound;        ///< A ζ that no map exceeds, if one is proven.
  std::vector<ObjectMatch> object_matches;  ///< The best object map so far.
  Seconds elapsed{0.0};                     ///< Time since the request was accepted.

  /// The best object map so far.
  [[nodiscard]] ObjectMap object_map() const;
};

/// Why a search ended. There is an answer in each case.
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

/// Two objects of one scene: the described object, and the one from which it is seen.
using ObjectPair = std::pair<std::uint32_t, std::uint32_t>;

/// A relation of two sketched objects and the relation of two mapped ones that it corresponds to.
struct FmapEntry {
  ObjectPair sketch_pair;         ///< The two sketched objects.
  ObjectPair map_pair;            ///< The two mapped ones.
  double similarity = 0.0;        ///< How alike the two relations are.
  double rotation_radians = 0.0;  ///< Rotation from sketch to map, counter-clockwise.
  double dilation = 0.0;          ///< Factor from sizes in the sketch to sizes on the map.
};

/// Another object map than the best one.
struct AlternativeMap {
  std::vector<ObjectMatch> object_matches;  ///< Its lines.
  FmapConfidence fmap_confidence;           ///< Its ζ.
  double omap_confidence = 0.0;             ///< Its Ω.
  std::optional<double> probability;        ///< How likely it is right.
};

/// Several maps that are about equally likely, as in a symmetric room.
struct Ambiguity {
  std::uint32_t maps = 0;                              ///< Their number, including the best one.
  std::vector<std::uint32_t> alternatives;             ///< Indices of the alternatives among them.
  std::vector<std::uint32_t> deciding_sketch_objects;  ///< Ask what the first of these is.
};

/// Objects that belong together, as several of one side are one place on the other.
struct ObjectGroup {
  std::vector<std::uint32_t> sketch_objects;  ///< Indices in the sketch.
  std::vector<std::uint32_t> map_objects;     ///< Indices in the map.
  std::optional<double> probability;          ///< How likely they belong together.
};

/// The effort of a match.
struct MatchStatistics {
  std::uint64_t iterations = 0;   ///< Iterations of the search.
  std::uint64_t evaluations = 0;  ///< Object maps evaluated.
  Seconds segment_elapsed{0.0};   ///< Time for finding the objects.
  Seconds describe_elapsed{0.0};  ///< Time for describing their relations.
  Seconds relate_elapsed{0.0};    ///< Time for comparing them.
  Seconds search_elapsed{0.0};    ///< Time for the search.
  Seconds total_elapsed{0.0};     ///< Time from acceptance to result.
};

/// The answer of a match.
struct MatchResult {
  std::string match_id;                                 ///< Name of the match.
  std::uint64_t seed = 0;                               ///< The seed that was used.
  Outcome outcome = Outcome::unspecified;               ///< Why the search ended.
  std::vector<ObjectMatch> object_matches;              ///< The object map, line by line.
  std::vector<std::uint32_t> unmatched_sketch_objects;  ///< Sketched objects without partner.
  std::vector<double> unmatched_sketch_probabilities;   ///< How likely each of them has none.
  std::vector<std::uint32_t> unmatched_map_objects;     ///< Mapped objects without partner.
  double omap_confidence = 0.0;                         ///< Ω, the mean confidence of the lines.
  FmapConfidence fmap_confidence;                       ///< ζ and its parts.
  std::optional<double> upper_bound;                    ///< A ζ that no map exceeds, if proven.
  std::vector<FmapEntry> fmap_entries;       ///< The relations that lead to the object map.
  double rotation_radians = 0.0;             ///< Rotation from sketch to map, counter-clockwise.
  double scale = 0.0;                        ///< Metres, or map units, per sketch unit.
  MatchStatistics statistics;                ///< Its effort.
  std::vector<AlternativeMap> alternatives;  ///< The next best object maps.
  std::string search_note;                   ///< A note of the searcher.
  std::optional<double> probability;         ///< How likely the whole answer is right.
  std::optional<double> place_probability;   ///< How likely the sketch shows this place.
  std::optional<Ambiguity> ambiguity;        ///< Object maps that are about as likely.
  bool provisional = false;                  ///< Whether a better answer follows, of a sketch.
  std::vector<ObjectGroup> object_groups;    ///< Objects that are several on one side.
};

/// A finished match. `operator<<` writes it as a small table.
struct Match {
  MatchAccepted accepted;  ///< The settings that were used.
  MatchScenes scenes;      ///< The objects that indices of the result refer to.
  MatchResult result;      ///< The answer.

  /// For each sketched object with a partner, the index of its mapped object, from 0.
  [[nodiscard]] ObjectMap object_map() const;
};

/// An event of a match.
using MatchEvent = std::variant<MatchAccepted, MatchScenes, Progress, MatchResult>;

/// An event with its number.
struct NumberedEvent {
  std::uint64_t number = 0;  ///< From 1, growing from each event to the next.
  MatchEvent event;          ///< The event.
};

/// The state of a match: queued, running, possibly cancelling, and then one of the others.
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

/// The state of a match and when it began and ended.
struct MatchSummary {
  using Time = std::chrono::system_clock::time_point;  ///< A point in time.

  std::string match_id;                        ///< Its name.
  std::string request_id;                      ///< `MatchOptions::request_id`.
  MatchState state = MatchState::unspecified;  ///< Its state.
  Time created_at;                             ///< When it was requested.
  std::optional<Time> ended_at;                ///< When it ended, if it has.
  Outcome outcome = Outcome::unspecified;      ///< Why its search ended, if it succeeded.
  std::uint64_t last_event = 0;                ///< The number of its latest event; 0 for none.
  std::string error_message;                   ///< Its error, if it did not succeed.
  std::string error_reason;                    ///< The reason of the error, for programs.
};

/// The state of a match with its events.
struct MatchRecord {
  MatchSummary match;                 ///< Its state.
  std::vector<NumberedEvent> events;  ///< Its events so far, with only the latest progress.
};

/// Called with each progress, at most 20 times a second. If it throws, the match ends.
using ProgressCallback = std::function<void(const Progress&)>;

}  // namespace sketchmatch
