/// @file
/// The fields of answers that the client knows, each named once: a value's member has the name of
/// the message's field. Decoding uses them, and the tests use them for encoding.
#pragma once

#include <sketchmatch/catalogue.hpp>
#include <sketchmatch/match.hpp>
#include <sketchmatch/scene.hpp>
#include <sketchmatch/stored.hpp>
#include <sketchmatch/transfer.hpp>
#include <tuple>
#include <utility>
#include <variant>

namespace sketchmatch::detail {

/// A field: its name in the contract, and how to reach it in a value and in a message.
template <typename Member, typename Get, typename Has>
struct Field {
  const char* name;
  Member member;  ///< The member of a value.
  Get get;        ///< The field of a message.
  Has has;        ///< Whether a message has it; callable where it can lack it.
};

template <typename Member, typename Get, typename Has>
constexpr Field<Member, Get, Has> field_of(const char* name, Member member, Get get, Has has) {
  return {name, member, get, has};
}

/// One of the things that a variant may hold.
template <typename Kind, typename Variant>
struct OneOf {
  Variant& variant;
};

template <typename Kind, typename Variant>
constexpr OneOf<Kind, Variant> one_of(Variant& variant) {
  return {variant};
}

// A function cannot name a field.
// NOLINTBEGIN(cppcoreguidelines-macro-usage)
#define MEMBER(name, member)                                                \
  field_of(                                                                 \
      #name, [](auto& value) -> decltype(auto) { return (member); },        \
      [](const auto& message) -> decltype(auto) { return message.name(); }, \
      [](const auto& message) -> decltype(message.has_##name()) { return message.has_##name(); })
/// A field with the name of the member.
#define FIELD(name) MEMBER(name, value.name)
/// A field that is held by the member `kind` if it is of this kind.
#define KIND(name, type) MEMBER(name, one_of<type>(value.kind))
// NOLINTEND(cppcoreguidelines-macro-usage)

/// Stands for a type.
template <typename Type>
struct Of {};

inline auto fields(Of<AlgorithmSelection> /*type*/) {
  return std::tuple{FIELD(name), FIELD(parameters)};
}

inline auto fields(Of<Pipeline> /*type*/) {
  return std::tuple{FIELD(sketch_segmenter), FIELD(map_segmenter), FIELD(histogram),
                    FIELD(similarity),       FIELD(searcher),      FIELD(judge),
                    FIELD(profile)};
}

inline auto fields(Of<Weights> /*type*/) {
  return std::tuple{FIELD(similarity), FIELD(rotation), FIELD(dilation),
                    FIELD(shape),      FIELD(size),     FIELD(distance)};
}

inline auto fields(Of<Point> /*type*/) { return std::tuple{FIELD(x), FIELD(y)}; }

inline auto fields(Of<SceneObject> /*type*/) {
  return std::tuple{FIELD(rings), FIELD(label), FIELD(area), FIELD(centroid), FIELD(certainty)};
}

inline auto fields(Of<Scene> /*type*/) { return std::tuple{FIELD(objects)}; }

inline auto fields(Of<MatchAccepted> /*type*/) {
  return std::tuple{FIELD(match_id),       FIELD(seed),        FIELD(pipeline),
                    FIELD(weights),        FIELD(time_budget), FIELD(unmatched_price),
                    FIELD(allow_unmatched)};
}

inline auto fields(Of<MatchScenes> /*type*/) {
  return std::tuple{FIELD(sketch), FIELD(map), FIELD(sketch_warnings), FIELD(map_warnings),
                    FIELD(sketch_route)};
}

inline auto fields(Of<ObjectRelation> /*type*/) {
  return std::tuple{FIELD(reference_object), FIELD(phrase), FIELD(degree)};
}

inline auto fields(Of<ObjectMatch> /*type*/) {
  return std::tuple{FIELD(sketch_object), FIELD(map_object), FIELD(sketch_label),
                    FIELD(map_label),     FIELD(confidence), FIELD(margin),
                    FIELD(relation),      FIELD(probability)};
}

inline auto fields(Of<Progress> /*type*/) {
  return std::tuple{FIELD(phase),          FIELD(fraction),   FIELD(iteration),
                    FIELD(evaluations),    FIELD(confidence), FIELD(upper_bound),
                    FIELD(object_matches), FIELD(elapsed)};
}

inline auto fields(Of<FmapConfidence> /*type*/) {
  return std::tuple{FIELD(total),    FIELD(similarity), FIELD(rotation),
                    FIELD(dilation), FIELD(shape),      FIELD(size)};
}

inline auto fields(Of<ObjectPair> /*type*/) { return std::tuple{FIELD(first), FIELD(second)}; }

inline auto fields(Of<FmapEntry> /*type*/) {
  return std::tuple{FIELD(sketch_pair), FIELD(map_pair), FIELD(similarity), FIELD(rotation_radians),
                    FIELD(dilation)};
}

inline auto fields(Of<AlternativeMap> /*type*/) {
  return std::tuple{FIELD(object_matches), FIELD(fmap_confidence), FIELD(omap_confidence),
                    FIELD(probability)};
}

inline auto fields(Of<Ambiguity> /*type*/) {
  return std::tuple{FIELD(maps), FIELD(alternatives), FIELD(deciding_sketch_objects)};
}

inline auto fields(Of<ObjectGroup> /*type*/) {
  return std::tuple{FIELD(sketch_objects), FIELD(map_objects), FIELD(probability)};
}

inline auto fields(Of<MatchStatistics> /*type*/) {
  return std::tuple{FIELD(iterations),       FIELD(evaluations),    FIELD(segment_elapsed),
                    FIELD(describe_elapsed), FIELD(relate_elapsed), FIELD(search_elapsed),
                    FIELD(total_elapsed)};
}

inline auto fields(Of<MatchResult> /*type*/) {
  return std::tuple{FIELD(match_id),
                    FIELD(seed),
                    FIELD(outcome),
                    FIELD(object_matches),
                    FIELD(unmatched_sketch_objects),
                    FIELD(unmatched_sketch_probabilities),
                    FIELD(unmatched_map_objects),
                    FIELD(omap_confidence),
                    FIELD(fmap_confidence),
                    FIELD(upper_bound),
                    FIELD(fmap_entries),
                    FIELD(rotation_radians),
                    FIELD(scale),
                    FIELD(statistics),
                    FIELD(alternatives),
                    FIELD(search_note),
                    FIELD(probability),
                    FIELD(place_probability),
                    FIELD(ambiguity),
                    FIELD(provisional),
                    FIELD(object_groups)};
}

inline auto fields(Of<MatchSummary> /*type*/) {
  return std::tuple{FIELD(match_id),   FIELD(request_id),    FIELD(state),
                    FIELD(created_at), FIELD(ended_at),      FIELD(outcome),
                    FIELD(last_event), FIELD(error_message), FIELD(error_reason)};
}

inline auto fields(Of<Passage> /*type*/) { return std::tuple{FIELD(first), FIELD(second)}; }

inline auto fields(Of<MapServerMap> /*type*/) {
  return std::tuple{FIELD(yaml), FIELD(image), FIELD(objects), FIELD(own_objects)};
}

inline auto fields(Of<Segmentation> /*type*/) {
  return std::tuple{FIELD(scene), FIELD(warnings), FIELD(segmenter),
                    FIELD(route), FIELD(passages), FIELD(map)};
}

inline auto fields(Of<StoredScene> /*type*/) {
  return std::tuple{FIELD(name),  FIELD(scene), FIELD(warnings), FIELD(segmenter),
                    FIELD(route), FIELD(title), FIELD(passages)};
}

inline auto fields(Of<PutScene> /*type*/) {
  return std::tuple{FIELD(stored_scene), FIELD(created)};
}

inline auto fields(Of<GotScene> /*type*/) { return std::tuple{FIELD(stored_scene), FIELD(source)}; }

inline auto fields(Of<SceneSummary> /*type*/) {
  return std::tuple{FIELD(name), FIELD(object_count), FIELD(labels), FIELD(put_time), FIELD(title)};
}

inline auto fields(Of<Route> /*type*/) {
  return std::tuple{FIELD(points), FIELD(speeds_meters_per_second)};
}

inline auto fields(Of<Zone> /*type*/) { return std::tuple{FIELD(rings)}; }

inline auto fields(Of<Feature> /*type*/) {
  return std::tuple{FIELD(name), KIND(point, Point), KIND(route, Route), KIND(zone, Zone)};
}

inline auto fields(Of<FeatureChange> /*type*/) {
  return std::tuple{FIELD(reason), FIELD(first_point), FIELD(last_point), FIELD(sentence)};
}

inline auto fields(Of<CarriedPoints> /*type*/) {
  return std::tuple{FIELD(deviations), FIELD(sources)};
}

inline auto fields(Of<CarriedFeature> /*type*/) {
  return std::tuple{FIELD(feature), FIELD(lines), FIELD(changes), FIELD(drawn)};
}

inline auto fields(Of<Warp> /*type*/) {
  return std::tuple{FIELD(kind), FIELD(rotation_radians), FIELD(scale), FIELD(residual),
                    FIELD(weights)};
}

inline auto fields(Of<Partners> /*type*/) {
  return std::tuple{FIELD(sketch_object), FIELD(map_object)};
}

inline auto fields(Of<Transfer> /*type*/) {
  return std::tuple{FIELD(features), FIELD(warp), MEMBER(object_map, value.partners), FIELD(scenes),
                    FIELD(match)};
}

inline auto fields(Of<Algorithm> /*type*/) {
  return std::tuple{FIELD(kind),
                    FIELD(name),
                    FIELD(summary),
                    FIELD(description),
                    FIELD(distribution),
                    FIELD(distribution_version),
                    FIELD(parameters_schema),
                    FIELD(is_default),
                    FIELD(source_kinds),
                    FIELD(source)};
}

inline auto fields(Of<Plugin> /*type*/) {
  return std::tuple{FIELD(distribution), FIELD(version), FIELD(state), FIELD(reason)};
}

inline auto fields(Of<Profile> /*type*/) {
  return std::tuple{FIELD(name),       FIELD(summary), FIELD(pipeline),
                    FIELD(is_default), FIELD(weights), FIELD(allow_unmatched)};
}

inline auto fields(Of<FileReader> /*type*/) {
  return std::tuple{FIELD(name),
                    FIELD(summary),
                    FIELD(suffixes),
                    FIELD(json_keys),
                    FIELD(source_kind),
                    FIELD(distribution),
                    FIELD(distribution_version)};
}

inline auto fields(Of<Catalogue> /*type*/) {
  return std::tuple{FIELD(algorithms), FIELD(plugins), FIELD(profiles), FIELD(readers)};
}

inline auto fields(Of<ServerLimits> /*type*/) {
  return std::tuple{FIELD(max_request_bytes),
                    FIELD(max_objects),
                    FIELD(max_concurrent_matches),
                    FIELD(max_time_budget),
                    FIELD(max_waiting),
                    FIELD(max_wait),
                    FIELD(default_time_budget),
                    FIELD(max_matches_per_caller),
                    FIELD(max_requests_per_minute),
                    FIELD(max_comparisons),
                    FIELD(max_candidates),
                    FIELD(max_waiting_bytes)};
}

inline auto fields(Of<ServerInfo> /*type*/) {
  return std::tuple{FIELD(version), FIELD(api_version), FIELD(plugin_api_version),
                    FIELD(limits),  FIELD(uptime),      FIELD(keeps_scenes)};
}

#undef KIND
#undef FIELD
#undef MEMBER

/// Calls a function with each field of a type.
template <typename Value, typename Visit>
void for_each_field(const Visit& visit) {
  std::apply([&](const auto&... field) { (visit(field), ...); }, fields(Of<Value>{}));
}

}  // namespace sketchmatch::detail
