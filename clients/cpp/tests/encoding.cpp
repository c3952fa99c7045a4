#include "encoding.hpp"

#include <cmath>

namespace sketchmatch::test {

namespace {

#define SET_IF_KNOWN(value, message, field) \
  if ((value).field) (message).set_##field(*(value).field)

google::protobuf::Duration encoded(Seconds value) {
  google::protobuf::Duration message;
  message.set_seconds(static_cast<std::int64_t>(std::floor(value.count())));
  message.set_nanos(
      static_cast<std::int32_t>((value.count() - std::floor(value.count())) * 1e9 + 0.5));
  return message;
}

google::protobuf::Timestamp encoded(MatchSummary::Time value) {
  constexpr std::int64_t kNanos = 1'000'000'000;
  const auto count =
      std::chrono::duration_cast<std::chrono::nanoseconds>(value.time_since_epoch()).count();
  google::protobuf::Timestamp message;
  message.set_seconds(count / kNanos);
  message.set_nanos(static_cast<std::int32_t>(count % kNanos));
  return message;
}

google::protobuf::Value encoded(const Value& value) {
  google::protobuf::Value message;
  const auto& kind = value.kind();
  if (std::holds_alternative<bool>(kind)) {
    message.set_bool_value(std::get<bool>(kind));
  } else if (std::holds_alternative<double>(kind)) {
    message.set_number_value(std::get<double>(kind));
  } else if (std::holds_alternative<std::string>(kind)) {
    message.set_string_value(std::get<std::string>(kind));
  } else if (std::holds_alternative<Value::List>(kind)) {
    message.mutable_list_value();
    for (const auto& each : std::get<Value::List>(kind)) {
      *message.mutable_list_value()->add_values() = encoded(each);
    }
  } else if (std::holds_alternative<Value::Object>(kind)) {
    message.mutable_struct_value();
    for (const auto& [name, each] : std::get<Value::Object>(kind)) {
      (*message.mutable_struct_value()->mutable_fields())[name] = encoded(each);
    }
  } else {
    message.set_null_value(google::protobuf::NULL_VALUE);
  }
  return message;
}

v1::AlgorithmSelection encoded(const AlgorithmSelection& value) {
  v1::AlgorithmSelection message;
  message.set_name(value.name);
  if (!value.parameters.empty()) {
    *message.mutable_parameters() = encoded(Value(value.parameters)).struct_value();
  }
  return message;
}

v1::Pipeline encoded(const Pipeline& value) {
  v1::Pipeline message;
  const auto put = [](const AlgorithmSelection& from, v1::AlgorithmSelection* (v1::Pipeline::*to)(),
                      v1::Pipeline& pipeline) {
    if (!from.name.empty()) {
      *(pipeline.*to)() = encoded(from);
    }
  };
  put(value.sketch_segmenter, &v1::Pipeline::mutable_sketch_segmenter, message);
  put(value.map_segmenter, &v1::Pipeline::mutable_map_segmenter, message);
  put(value.histogram, &v1::Pipeline::mutable_histogram, message);
  put(value.similarity, &v1::Pipeline::mutable_similarity, message);
  put(value.searcher, &v1::Pipeline::mutable_searcher, message);
  put(value.judge, &v1::Pipeline::mutable_judge, message);
  message.set_profile(value.profile);
  return message;
}

v1::ConfidenceWeights encoded(const Weights& value) {
  v1::ConfidenceWeights message;
  message.set_similarity(value.similarity);
  message.set_rotation(value.rotation);
  message.set_dilation(value.dilation);
  SET_IF_KNOWN(value, message, shape);
  SET_IF_KNOWN(value, message, size);
  SET_IF_KNOWN(value, message, distance);
  return message;
}

v1::Point encoded(const Point& value) {
  v1::Point message;
  message.set_x(value.x);
  message.set_y(value.y);
  return message;
}

v1::Scene encoded(const Scene& value) {
  v1::Scene message;
  for (const auto& each : value.objects) {
    auto* object = message.add_objects();
    object->set_label(each.label);
    object->set_area(each.area);
    *object->mutable_centroid() = encoded(each.centroid);
    SET_IF_KNOWN(each, *object, certainty);
    for (const auto& ring : each.rings) {
      auto* points = object->add_rings();
      for (const auto& corner : ring) {
        *points->add_points() = encoded(corner);
      }
    }
  }
  return message;
}

v1::ObjectMatch encoded(const ObjectMatch& value) {
  v1::ObjectMatch message;
  message.set_sketch_object(value.sketch_object);
  message.set_map_object(value.map_object);
  message.set_sketch_label(value.sketch_label);
  message.set_map_label(value.map_label);
  message.set_confidence(value.confidence);
  SET_IF_KNOWN(value, message, margin);
  SET_IF_KNOWN(value, message, probability);
  if (value.relation) {
    auto* relation = message.mutable_relation();
    relation->set_reference_object(value.relation->reference_object);
    relation->set_phrase(value.relation->phrase);
    relation->set_degree(value.relation->degree);
  }
  return message;
}

v1::FmapConfidence encoded(const FmapConfidence& value) {
  v1::FmapConfidence message;
  message.set_total(value.total);
  message.set_similarity(value.similarity);
  message.set_rotation(value.rotation);
  message.set_dilation(value.dilation);
  SET_IF_KNOWN(value, message, shape);
  SET_IF_KNOWN(value, message, size);
  return message;
}

v1::ObjectPair encoded(const ObjectPair& value) {
  v1::ObjectPair message;
  message.set_first(value.first);
  message.set_second(value.second);
  return message;
}

template <typename Value, typename Field>
void put_all(const std::vector<Value>& values, Field* field) {
  for (const auto& each : values) {
    if constexpr (std::is_arithmetic_v<Value>) {
      field->Add(each);
    } else if constexpr (std::is_same_v<Value, std::string>) {
      *field->Add() = each;
    } else {
      *field->Add() = encoded(each);
    }
  }
}

}  // namespace

v1::MatchAccepted encoded(const MatchAccepted& value) {
  v1::MatchAccepted message;
  message.set_match_id(value.match_id);
  message.set_seed(value.seed);
  *message.mutable_pipeline() = encoded(value.pipeline);
  *message.mutable_weights() = encoded(value.weights);
  if (value.time_budget) {
    *message.mutable_time_budget() = encoded(*value.time_budget);
  }
  SET_IF_KNOWN(value, message, unmatched_price);
  return message;
}

v1::MatchScenes encoded(const MatchScenes& value) {
  v1::MatchScenes message;
  *message.mutable_sketch() = encoded(value.sketch);
  *message.mutable_map() = encoded(value.map);
  put_all(value.sketch_warnings, message.mutable_sketch_warnings());
  put_all(value.map_warnings, message.mutable_map_warnings());
  put_all(value.sketch_route, message.mutable_sketch_route());
  return message;
}

v1::MatchProgress encoded(const Progress& value) {
  v1::MatchProgress message;
  message.set_phase(static_cast<v1::Phase>(value.phase));
  SET_IF_KNOWN(value, message, fraction);
  message.set_iteration(value.iteration);
  message.set_evaluations(value.evaluations);
  SET_IF_KNOWN(value, message, confidence);
  SET_IF_KNOWN(value, message, upper_bound);
  put_all(value.object_matches, message.mutable_object_matches());
  *message.mutable_elapsed() = encoded(value.elapsed);
  return message;
}

v1::MatchResult encoded(const MatchResult& value) {
  v1::MatchResult message;
  message.set_match_id(value.match_id);
  message.set_seed(value.seed);
  message.set_outcome(static_cast<v1::Outcome>(value.outcome));
  put_all(value.object_matches, message.mutable_object_matches());
  put_all(value.unmatched_sketch_objects, message.mutable_unmatched_sketch_objects());
  put_all(value.unmatched_sketch_probabilities, message.mutable_unmatched_sketch_probabilities());
  put_all(value.unmatched_map_objects, message.mutable_unmatched_map_objects());
  message.set_omap_confidence(value.omap_confidence);
  *message.mutable_fmap_confidence() = encoded(value.fmap_confidence);
  SET_IF_KNOWN(value, message, upper_bound);
  for (const auto& each : value.fmap_entries) {
    auto* entry = message.add_fmap_entries();
    *entry->mutable_sketch_pair() = encoded(each.sketch_pair);
    *entry->mutable_map_pair() = encoded(each.map_pair);
    entry->set_similarity(each.similarity);
    entry->set_rotation_radians(each.rotation_radians);
    entry->set_dilation(each.dilation);
  }
  message.set_rotation_radians(value.rotation_radians);
  message.set_scale(value.scale);
  auto* statistics = message.mutable_statistics();
  statistics->set_iterations(value.statistics.iterations);
  statistics->set_evaluations(value.statistics.evaluations);
  *statistics->mutable_segment_elapsed() = encoded(value.statistics.segment_elapsed);
  *statistics->mutable_describe_elapsed() = encoded(value.statistics.describe_elapsed);
  *statistics->mutable_relate_elapsed() = encoded(value.statistics.relate_elapsed);
  *statistics->mutable_search_elapsed() = encoded(value.statistics.search_elapsed);
  *statistics->mutable_total_elapsed() = encoded(value.statistics.total_elapsed);
  for (const auto& each : value.alternatives) {
    auto* alternative = message.add_alternatives();
    put_all(each.object_matches, alternative->mutable_object_matches());
    *alternative->mutable_fmap_confidence() = encoded(each.fmap_confidence);
    alternative->set_omap_confidence(each.omap_confidence);
    SET_IF_KNOWN(each, *alternative, probability);
  }
  message.set_search_note(value.search_note);
  SET_IF_KNOWN(value, message, probability);
  SET_IF_KNOWN(value, message, place_probability);
  if (value.ambiguity) {
    auto* ambiguity = message.mutable_ambiguity();
    ambiguity->set_maps(value.ambiguity->maps);
    put_all(value.ambiguity->alternatives, ambiguity->mutable_alternatives());
    put_all(value.ambiguity->deciding_sketch_objects, ambiguity->mutable_deciding_sketch_objects());
  }
  message.set_provisional(value.provisional);
  return message;
}

v1::MatchSummary encoded(const MatchSummary& value) {
  v1::MatchSummary message;
  message.set_match_id(value.match_id);
  message.set_request_id(value.request_id);
  message.set_state(static_cast<v1::MatchState>(value.state));
  *message.mutable_created_at() = encoded(value.created_at);
  if (value.ended_at) {
    *message.mutable_ended_at() = encoded(*value.ended_at);
  }
  message.set_outcome(static_cast<v1::Outcome>(value.outcome));
  message.set_last_event(value.last_event);
  message.set_error_message(value.error_message);
  message.set_error_reason(value.error_reason);
  return message;
}

v1::SegmentResponse encoded(const Segmentation& value) {
  v1::SegmentResponse message;
  *message.mutable_scene() = encoded(value.scene);
  put_all(value.warnings, message.mutable_warnings());
  *message.mutable_segmenter() = encoded(value.segmenter);
  put_all(value.route, message.mutable_route());
  return message;
}

v1::ListAlgorithmsResponse encoded(const Catalogue& value) {
  v1::ListAlgorithmsResponse message;
  for (const auto& each : value.algorithms) {
    auto* algorithm = message.add_algorithms();
    algorithm->set_kind(static_cast<v1::AlgorithmKind>(each.kind));
    algorithm->set_name(each.name);
    algorithm->set_summary(each.summary);
    algorithm->set_description(each.description);
    algorithm->set_distribution(each.distribution);
    algorithm->set_distribution_version(each.distribution_version);
    *algorithm->mutable_parameters_schema() = encoded(Value(each.parameters_schema)).struct_value();
    algorithm->set_is_default(each.is_default);
    for (const auto kind : each.source_kinds) {
      algorithm->add_source_kinds(static_cast<v1::SourceKind>(kind));
    }
    algorithm->set_source(each.source);
  }
  for (const auto& each : value.plugins) {
    auto* plugin = message.add_plugins();
    plugin->set_distribution(each.distribution);
    plugin->set_version(each.version);
    plugin->set_state(static_cast<v1::PluginState>(each.state));
    plugin->set_reason(each.reason);
  }
  for (const auto& each : value.profiles) {
    auto* profile = message.add_profiles();
    profile->set_name(each.name);
    profile->set_summary(each.summary);
    *profile->mutable_pipeline() = encoded(each.pipeline);
    profile->set_is_default(each.is_default);
    if (each.weights) {
      *profile->mutable_weights() = encoded(*each.weights);
    }
    profile->set_allow_unmatched(each.allow_unmatched);
  }
  for (const auto& each : value.readers) {
    auto* reader = message.add_readers();
    reader->set_name(each.name);
    reader->set_summary(each.summary);
    put_all(each.suffixes, reader->mutable_suffixes());
    put_all(each.json_keys, reader->mutable_json_keys());
    reader->set_source_kind(static_cast<v1::SourceKind>(each.source_kind));
    reader->set_distribution(each.distribution);
    reader->set_distribution_version(each.distribution_version);
  }
  return message;
}

v1::GetServerInfoResponse encoded(const ServerInfo& value) {
  v1::GetServerInfoResponse message;
  message.set_version(value.version);
  message.set_api_version(value.api_version);
  message.set_plugin_api_version(value.plugin_api_version);
  auto* limits = message.mutable_limits();
  SET_IF_KNOWN(value.limits, *limits, max_request_bytes);
  SET_IF_KNOWN(value.limits, *limits, max_objects);
  SET_IF_KNOWN(value.limits, *limits, max_concurrent_matches);
  SET_IF_KNOWN(value.limits, *limits, max_waiting);
  if (value.limits.max_time_budget) {
    *limits->mutable_max_time_budget() = encoded(*value.limits.max_time_budget);
  }
  if (value.limits.max_wait) {
    *limits->mutable_max_wait() = encoded(*value.limits.max_wait);
  }
  if (value.limits.default_time_budget) {
    *limits->mutable_default_time_budget() = encoded(*value.limits.default_time_budget);
  }
  SET_IF_KNOWN(value.limits, *limits, max_matches_per_caller);
  SET_IF_KNOWN(value.limits, *limits, max_requests_per_minute);
  SET_IF_KNOWN(value.limits, *limits, max_comparisons);
  SET_IF_KNOWN(value.limits, *limits, max_candidates);
  *message.mutable_uptime() = encoded(value.uptime);
  message.set_keeps_scenes(value.keeps_scenes);
  return message;
}

}  // namespace sketchmatch::test
