#include "decoding.hpp"

#include <string>
#include <utility>
#include <vector>

namespace sketchmatch {

namespace {

template <typename Line>
ObjectMap map_of(const std::vector<Line>& lines) {
  ObjectMap map;
  for (const auto& line : lines) {
    map.emplace(line.sketch_object, line.map_object);
  }
  return map;
}

}  // namespace

ObjectMap Progress::object_map() const { return map_of(object_matches); }

ObjectMap Match::object_map() const { return map_of(result.object_matches); }

ObjectMap Transfer::object_map() const { return map_of(partners); }

namespace detail {

namespace {

/// Returns a value where a message has it.
// NOLINTNEXTLINE(cppcoreguidelines-macro-usage): a function cannot name a field
#define SKETCHMATCH_KNOWN(message, field) \
  ((message).has_##field() ? std::optional((message).field()) : std::nullopt)

Seconds decoded(const google::protobuf::Duration& message) {
  return std::chrono::seconds(message.seconds()) +
         Seconds(std::chrono::nanoseconds(message.nanos()));
}

std::chrono::system_clock::time_point decoded(const google::protobuf::Timestamp& message) {
  using Time = std::chrono::system_clock::time_point;
  return Time(std::chrono::duration_cast<Time::duration>(
      std::chrono::seconds(message.seconds()) + std::chrono::nanoseconds(message.nanos())));
}

Parameters decoded(const google::protobuf::Struct& message);

Value decoded(const google::protobuf::Value& message) {
  switch (message.kind_case()) {
    case google::protobuf::Value::kBoolValue:
      return message.bool_value();
    case google::protobuf::Value::kNumberValue:
      return message.number_value();
    case google::protobuf::Value::kStringValue:
      return message.string_value();
    case google::protobuf::Value::kListValue: {
      Value::List list;
      for (const auto& each : message.list_value().values()) {
        list.push_back(decoded(each));
      }
      return list;
    }
    case google::protobuf::Value::kStructValue:
      return decoded(message.struct_value());
    default:
      return nullptr;
  }
}

Parameters decoded(const google::protobuf::Struct& message) {
  Parameters values;
  for (const auto& [name, value] : message.fields()) {
    values.emplace(name, decoded(value));
  }
  return values;
}

AlgorithmSelection decoded(const v1::AlgorithmSelection& message) {
  return {message.name(), decoded(message.parameters())};
}

Pipeline decoded(const v1::Pipeline& message) {
  return {decoded(message.sketch_segmenter()),
          decoded(message.map_segmenter()),
          decoded(message.histogram()),
          decoded(message.similarity()),
          decoded(message.searcher()),
          decoded(message.judge()),
          message.profile()};
}

Weights decoded(const v1::ConfidenceWeights& message) {
  const auto one_if_absent = [](const std::optional<double>& weight) {
    return weight.value_or(1.0);
  };
  return {one_if_absent(SKETCHMATCH_KNOWN(message, similarity)),
          one_if_absent(SKETCHMATCH_KNOWN(message, rotation)),
          one_if_absent(SKETCHMATCH_KNOWN(message, dilation)),
          SKETCHMATCH_KNOWN(message, shape),
          SKETCHMATCH_KNOWN(message, size),
          SKETCHMATCH_KNOWN(message, distance)};
}

Point decoded(const v1::Point& message) { return {message.x(), message.y()}; }

// What repeated fields hold, before they ask for it.
SceneObject decoded(const v1::SceneObject& message);
ObjectMatch decoded(const v1::ObjectMatch& message);
FmapEntry decoded(const v1::FmapEntry& message);
AlternativeMap decoded(const v1::AlternativeMap& message);
ObjectGroup decoded(const v1::ObjectGroup& message);
Algorithm decoded(const v1::Algorithm& message);
Plugin decoded(const v1::Plugin& message);
Profile decoded(const v1::Profile& message);
FileReader decoded(const v1::FileReader& message);
Partners decoded(const v1::Partners& message);
CarriedPoints decoded(const v1::CarriedPoints& message);
FeatureChange decoded(const v1::FeatureChange& message);
CarriedFeature decoded(const v1::CarriedFeature& message);

/// Returns the values of a repeated field.
template <typename Field>
auto all(const Field& messages) {
  std::vector<decltype(decoded(messages.Get(0)))> values;
  values.reserve(static_cast<std::size_t>(messages.size()));
  for (const auto& each : messages) {
    values.push_back(decoded(each));
  }
  return values;
}

template <typename Field>
std::vector<std::string> texts(const Field& field) {
  return {field.begin(), field.end()};
}

template <typename Field>
std::vector<std::uint32_t> numbers(const Field& field) {
  return {field.begin(), field.end()};
}

template <typename Field>
std::vector<double> reals(const Field& field) {
  return {field.begin(), field.end()};
}

template <typename Field>
std::vector<Ring> rings(const Field& field) {
  std::vector<Ring> values;
  for (const auto& ring : field) {
    values.push_back(all(ring.points()));
  }
  return values;
}

SceneObject decoded(const v1::SceneObject& message) {
  return {rings(message.rings()), message.label(), message.area(), decoded(message.centroid()),
          SKETCHMATCH_KNOWN(message, certainty)};
}

Scene decoded(const v1::Scene& message) { return {all(message.objects())}; }

MatchAccepted decoded(const v1::MatchAccepted& message) {
  return {message.match_id(),
          message.seed(),
          decoded(message.pipeline()),
          decoded(message.weights()),
          message.has_time_budget() ? std::optional(decoded(message.time_budget())) : std::nullopt,
          SKETCHMATCH_KNOWN(message, unmatched_price)};
}

MatchScenes decoded(const v1::MatchScenes& message) {
  return {decoded(message.sketch()), decoded(message.map()), texts(message.sketch_warnings()),
          texts(message.map_warnings()), all(message.sketch_route())};
}

ObjectRelation decoded(const v1::ObjectRelation& message) {
  return {message.reference_object(), message.phrase(), message.degree()};
}

ObjectMatch decoded(const v1::ObjectMatch& message) {
  return {message.sketch_object(),
          message.map_object(),
          message.sketch_label(),
          message.map_label(),
          message.confidence(),
          SKETCHMATCH_KNOWN(message, margin),
          message.has_relation() ? std::optional(decoded(message.relation())) : std::nullopt,
          SKETCHMATCH_KNOWN(message, probability)};
}

Progress decoded(const v1::MatchProgress& message) {
  return {static_cast<Phase>(message.phase()),
          SKETCHMATCH_KNOWN(message, fraction),
          message.iteration(),
          message.evaluations(),
          SKETCHMATCH_KNOWN(message, confidence),
          SKETCHMATCH_KNOWN(message, upper_bound),
          all(message.object_matches()),
          decoded(message.elapsed())};
}

FmapConfidence decoded(const v1::FmapConfidence& message) {
  return {message.total(),
          message.similarity(),
          message.rotation(),
          message.dilation(),
          SKETCHMATCH_KNOWN(message, shape),
          SKETCHMATCH_KNOWN(message, size)};
}

FmapEntry decoded(const v1::FmapEntry& message) {
  return {{message.sketch_pair().first(), message.sketch_pair().second()},
          {message.map_pair().first(), message.map_pair().second()},
          message.similarity(),
          message.rotation_radians(),
          message.dilation()};
}

AlternativeMap decoded(const v1::AlternativeMap& message) {
  return {all(message.object_matches()), decoded(message.fmap_confidence()),
          message.omap_confidence(), SKETCHMATCH_KNOWN(message, probability)};
}

Ambiguity decoded(const v1::Ambiguity& message) {
  return {message.maps(), numbers(message.alternatives()),
          numbers(message.deciding_sketch_objects())};
}

ObjectGroup decoded(const v1::ObjectGroup& message) {
  return {numbers(message.sketch_objects()), numbers(message.map_objects()),
          SKETCHMATCH_KNOWN(message, probability)};
}

MatchStatistics decoded(const v1::MatchStatistics& message) {
  return {message.iterations(),
          message.evaluations(),
          decoded(message.segment_elapsed()),
          decoded(message.describe_elapsed()),
          decoded(message.relate_elapsed()),
          decoded(message.search_elapsed()),
          decoded(message.total_elapsed())};
}

MatchResult decoded(const v1::MatchResult& message) {
  MatchResult result;
  result.match_id = message.match_id();
  result.seed = message.seed();
  result.outcome = static_cast<Outcome>(message.outcome());
  result.object_matches = all(message.object_matches());
  result.unmatched_sketch_objects = numbers(message.unmatched_sketch_objects());
  result.unmatched_sketch_probabilities = reals(message.unmatched_sketch_probabilities());
  result.unmatched_map_objects = numbers(message.unmatched_map_objects());
  result.omap_confidence = message.omap_confidence();
  result.fmap_confidence = decoded(message.fmap_confidence());
  result.upper_bound = SKETCHMATCH_KNOWN(message, upper_bound);
  result.fmap_entries = all(message.fmap_entries());
  result.rotation_radians = message.rotation_radians();
  result.scale = message.scale();
  result.statistics = decoded(message.statistics());
  result.alternatives = all(message.alternatives());
  result.search_note = message.search_note();
  result.probability = SKETCHMATCH_KNOWN(message, probability);
  result.place_probability = SKETCHMATCH_KNOWN(message, place_probability);
  if (message.has_ambiguity()) {
    result.ambiguity = decoded(message.ambiguity());
  }
  result.provisional = message.provisional();
  result.object_groups = all(message.object_groups());
  return result;
}

template <typename Field>
std::vector<SourceKind> kinds(const Field& field) {
  std::vector<SourceKind> found;
  for (const int kind : field) {
    found.push_back(static_cast<SourceKind>(kind));
  }
  return found;
}

Algorithm decoded(const v1::Algorithm& message) {
  return {static_cast<AlgorithmKind>(message.kind()),
          message.name(),
          message.summary(),
          message.description(),
          message.distribution(),
          message.distribution_version(),
          decoded(message.parameters_schema()),
          message.is_default(),
          kinds(message.source_kinds()),
          message.source()};
}

Plugin decoded(const v1::Plugin& message) {
  return {message.distribution(), message.version(), static_cast<PluginState>(message.state()),
          message.reason()};
}

Profile decoded(const v1::Profile& message) {
  return {message.name(),
          message.summary(),
          decoded(message.pipeline()),
          message.is_default(),
          message.has_weights() ? std::optional(decoded(message.weights())) : std::nullopt,
          message.allow_unmatched()};
}

FileReader decoded(const v1::FileReader& message) {
  return {message.name(),
          message.summary(),
          texts(message.suffixes()),
          texts(message.json_keys()),
          static_cast<SourceKind>(message.source_kind()),
          message.distribution(),
          message.distribution_version()};
}

ServerLimits decoded(const v1::ServerLimits& message) {
  ServerLimits limits;
  limits.max_request_bytes = SKETCHMATCH_KNOWN(message, max_request_bytes);
  limits.max_objects = SKETCHMATCH_KNOWN(message, max_objects);
  limits.max_concurrent_matches = SKETCHMATCH_KNOWN(message, max_concurrent_matches);
  if (message.has_max_time_budget()) {
    limits.max_time_budget = decoded(message.max_time_budget());
  }
  limits.max_waiting = SKETCHMATCH_KNOWN(message, max_waiting);
  if (message.has_max_wait()) {
    limits.max_wait = decoded(message.max_wait());
  }
  if (message.has_default_time_budget()) {
    limits.default_time_budget = decoded(message.default_time_budget());
  }
  limits.max_matches_per_caller = SKETCHMATCH_KNOWN(message, max_matches_per_caller);
  limits.max_requests_per_minute = SKETCHMATCH_KNOWN(message, max_requests_per_minute);
  limits.max_comparisons = SKETCHMATCH_KNOWN(message, max_comparisons);
  limits.max_candidates = SKETCHMATCH_KNOWN(message, max_candidates);
  return limits;
}

Partners decoded(const v1::Partners& message) {
  return {message.sketch_object(), message.map_object()};
}

Feature decoded(const v1::Feature& message) {
  switch (message.kind_case()) {
    case v1::Feature::kPoint:
      return {message.name(), decoded(message.point())};
    case v1::Feature::kRoute:
      return {message.name(), Route{all(message.route().points()),
                                    reals(message.route().speeds_meters_per_second())}};
    case v1::Feature::kZone:
      return {message.name(), Zone{rings(message.zone().rings())}};
    default:
      return {message.name(), {}};
  }
}

CarriedPoints decoded(const v1::CarriedPoints& message) {
  return {reals(message.deviations()), reals(message.sources())};
}

FeatureChange decoded(const v1::FeatureChange& message) {
  return {static_cast<ChangeReason>(message.reason()), message.first_point(), message.last_point(),
          message.sentence()};
}

CarriedFeature decoded(const v1::CarriedFeature& message) {
  return {decoded(message.feature()), all(message.lines()), all(message.changes()),
          message.drawn()};
}

Warp decoded(const v1::Warp& message) {
  return {static_cast<WarpKind>(message.kind()), message.rotation_radians(), message.scale(),
          message.residual(), reals(message.weights())};
}

}  // namespace

std::optional<MatchEvent> decoded(const v1::MatchResponse& message) {
  switch (message.event_case()) {
    case v1::MatchResponse::kAccepted:
      return decoded(message.accepted());
    case v1::MatchResponse::kScenes:
      return decoded(message.scenes());
    case v1::MatchResponse::kProgress:
      return decoded(message.progress());
    case v1::MatchResponse::kResult:
      return decoded(message.result());
    default:
      return std::nullopt;
  }
}

MatchSummary decoded(const v1::MatchSummary& message) {
  return {message.match_id(),
          message.request_id(),
          static_cast<MatchState>(message.state()),
          decoded(message.created_at()),
          message.has_ended_at() ? std::optional(decoded(message.ended_at())) : std::nullopt,
          static_cast<Outcome>(message.outcome()),
          message.last_event(),
          message.error_message(),
          message.error_reason()};
}

MatchRecord decoded(const v1::GetMatchResponse& message) {
  MatchRecord record{decoded(message.match()), {}};
  for (const auto& each : message.events()) {
    if (auto event = decoded(each)) {
      record.events.push_back({each.number(), *std::move(event)});
    }
  }
  return record;
}

Segmentation decoded(const v1::SegmentResponse& message) {
  return {decoded(message.scene()), texts(message.warnings()), decoded(message.segmenter()),
          all(message.route())};
}

StoredScene decoded(const v1::StoredScene& message) {
  return {message.name(), decoded(message.scene()), texts(message.warnings()),
          decoded(message.segmenter()), all(message.route())};
}

PutScene decoded(const v1::PutSceneResponse& message) {
  return {decoded(message.stored_scene()), message.created()};
}

GotScene decoded(const v1::GetSceneResponse& message) {
  return {decoded(message.stored_scene()),
          message.has_source() ? std::optional<Source>(message.source()) : std::nullopt};
}

SceneSummary decoded(const v1::SceneSummary& message) {
  return {message.name(), message.object_count(), texts(message.labels()),
          decoded(message.put_time())};
}

Transfer decoded(const v1::TransferResponse& message) {
  return {all(message.features()), decoded(message.warp()), all(message.object_map()),
          decoded(message.scenes()),
          message.has_match() ? std::optional(decoded(message.match())) : std::nullopt};
}

Catalogue decoded(const v1::ListAlgorithmsResponse& message) {
  return {all(message.algorithms()), all(message.plugins()), all(message.profiles()),
          all(message.readers())};
}

ServerInfo decoded(const v1::GetServerInfoResponse& message) {
  return {message.version(),         message.api_version(),     message.plugin_api_version(),
          decoded(message.limits()), decoded(message.uptime()), message.keeps_scenes()};
}

}  // namespace detail
}  // namespace sketchmatch
