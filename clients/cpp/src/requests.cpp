#include "requests.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <variant>

#include "points.hpp"
#include "text.hpp"

namespace sketchmatch::detail {

namespace {

/// A stage of the pipeline: its name, its option, and its field in the message.
struct Stage {
  const char* name;
  std::string MatchOptions::*option;
  v1::AlgorithmSelection* (v1::Pipeline::*selection)();
};

constexpr std::array kStages{
    Stage{"sketch_segmenter", &MatchOptions::sketch_segmenter,
          &v1::Pipeline::mutable_sketch_segmenter},
    Stage{"map_segmenter", &MatchOptions::map_segmenter, &v1::Pipeline::mutable_map_segmenter},
    Stage{"histogram", &MatchOptions::histogram, &v1::Pipeline::mutable_histogram},
    Stage{"similarity", &MatchOptions::similarity, &v1::Pipeline::mutable_similarity},
    Stage{"searcher", &MatchOptions::searcher, &v1::Pipeline::mutable_searcher},
    Stage{"judge", &MatchOptions::judge, &v1::Pipeline::mutable_judge}};

void write(const Value& value, google::protobuf::Value& message, const std::string& field);

void write(const Value::Object& values, google::protobuf::Struct& message,
           const std::string& field) {
  for (const auto& [name, value] : values) {
    write(value, (*message.mutable_fields())[checked_text(name, field)], field);
  }
}

void write(const Value& value, google::protobuf::Value& message, const std::string& field) {
  const auto& kind = value.kind();
  if (const auto* flag = std::get_if<bool>(&kind)) {
    message.set_bool_value(*flag);
  } else if (const auto* number = std::get_if<double>(&kind)) {
    message.set_number_value(*number);
  } else if (const auto* text = std::get_if<std::string>(&kind)) {
    message.set_string_value(checked_text(*text, field));
  } else if (const auto* list = std::get_if<Value::List>(&kind)) {
    auto* values = message.mutable_list_value();
    for (const auto& each : *list) {
      write(each, *values->add_values(), field);
    }
  } else if (const auto* object = std::get_if<Value::Object>(&kind)) {
    write(*object, *message.mutable_struct_value(), field);
  } else {
    message.set_null_value(google::protobuf::NULL_VALUE);
  }
}

void select(const std::string& name, const Parameters& params, v1::AlgorithmSelection& selection,
            const std::string& field) {
  selection.set_name(checked_text(name, field + ".name"));
  if (!params.empty()) {
    write(params, *selection.mutable_parameters(), field + ".parameters");
  }
}

void write(const MatchOptions& options, v1::Pipeline& pipeline) {
  const Parameters none;
  for (const auto& stage : kStages) {
    const auto& name = options.*stage.option;
    const auto found = options.params.find(stage.name);
    const auto& params = found == options.params.end() ? none : found->second;
    if (!name.empty() || !params.empty()) {
      select(name, params, *(pipeline.*stage.selection)(), std::string("pipeline.") + stage.name);
    }
  }
  for (const auto& [name, params] : options.params) {
    std::string known;
    bool is_one = false;
    for (const auto& stage : kStages) {
      is_one = is_one || name == stage.name;
      known += std::string(known.empty() ? "" : ", ") + stage.name;
    }
    if (!is_one) {
      throw InvalidRequestError(
          "params has no stage " + in_quotes(name) + "; the stages are " + known, "INVALID_FIELD",
          "pipeline");
    }
  }
  pipeline.set_profile(checked_text(options.profile, "profile"));
}

void write(Seconds budget, google::protobuf::Duration& message) {
  constexpr double kNanos = 1e9;
  constexpr double kMost = 315'576'000'000.0;  // of a Duration: 10 000 years
  const double seconds = budget.count();
  if (!(std::abs(seconds) <= kMost)) {
    refuse("time_budget",
           "is " + shown(seconds) + "; give a positive time in seconds, or none at all");
  }
  const double whole = std::trunc(seconds);
  auto nanos = std::llround((seconds - whole) * kNanos);
  auto count = static_cast<std::int64_t>(whole);
  if (nanos == static_cast<long long>(kNanos)) {
    nanos = 0;
    ++count;
  }
  message.set_seconds(count);
  message.set_nanos(static_cast<std::int32_t>(nanos));
}

void write(const Weights& weights, v1::ConfidenceWeights& message) {
  message.set_similarity(weights.similarity);
  message.set_rotation(weights.rotation);
  message.set_dilation(weights.dilation);
  if (weights.shape) {
    message.set_shape(*weights.shape);
  }
  if (weights.size) {
    message.set_size(*weights.size);
  }
  if (weights.distance) {
    message.set_distance(*weights.distance);
  }
}

void write(const ObjectReference& reference, v1::ObjectReference& message,
           const std::string& field) {
  if (const auto* label = std::get_if<std::string>(&reference.kind())) {
    message.set_label(checked_text(*label, field));
    return;
  }
  const auto index = std::get<std::int64_t>(reference.kind());
  if (index < 0 || index > std::numeric_limits<std::uint32_t>::max()) {
    refuse(field, "is " + std::to_string(index) + "; give the index of an object, from 0");
  }
  message.set_index(static_cast<std::uint32_t>(index));
}

void write(const Pin& pin, v1::Pin& message, const std::string& field) {
  write(pin.sketch, *message.mutable_sketch_object(), field + ".sketch_object");
  if (pin.map) {
    write(*pin.map, *message.mutable_map_object(), field + ".map_object");
  }
  message.set_excluded(pin.excluded);
}

std::string numbered(const char* field, int number) {
  return std::string(field) + "[" + std::to_string(number) + "]";
}

/// Writes what a match and a transfer have in common.
template <typename Request>
void write_common(const Source& sketch, const Source& map, const MatchOptions& options,
                  Request& request) {
  *request.mutable_sketch() = sketch.message();
  *request.mutable_map() = map.message();
  write(options, *request.mutable_pipeline());
  if (options.seed) {
    request.set_seed(*options.seed);
  }
  if (options.time_budget) {
    write(*options.time_budget, *request.mutable_time_budget());
  }
  if (options.weights) {
    write(*options.weights, *request.mutable_weights());
  }
  if (options.allow_unmatched) {
    request.set_allow_unmatched(*options.allow_unmatched);
  }
  if (options.unmatched_price) {
    request.set_unmatched_price(*options.unmatched_price);
  }
  for (const auto& pin : options.pins) {
    const auto field = numbered("pins", request.pins_size());
    write(pin, *request.add_pins(), field);
  }
  for (const auto& group : options.synonyms) {
    const auto field = numbered("synonyms", request.synonyms_size());
    auto* synonyms = request.add_synonyms();
    for (const auto& label : group) {
      synonyms->add_labels(checked_text(label, field));
    }
  }
}

/// Writes a source and how to find its objects.
template <typename Request>
void write_segmenting(const Source& source, const SegmentOptions& options, Request& request) {
  *request.mutable_source() = source.message();
  request.set_profile(checked_text(options.profile, "profile"));
  if (!options.segmenter.empty() || !options.params.empty()) {
    select(options.segmenter, options.params, *request.mutable_segmenter(), "segmenter");
  }
}

/// Throws if an option is given that is only for matches.
void refuse_for_transfer(bool given, const char* option) {
  if (given) {
    refuse(option, "is only for matches; leave it out of a transfer");
  }
}

void write(const Feature& feature, v1::Feature& message, const std::string& field) {
  message.set_name(checked_text(feature.name, field + ".name"));
  if (const auto* point = std::get_if<Point>(&feature.kind)) {
    write_point(*point, *message.mutable_point());
  } else if (const auto* route = std::get_if<Route>(&feature.kind)) {
    auto* written = message.mutable_route();
    write_points(route->points, *written);
    for (const double speed : route->speeds_meters_per_second) {
      written->add_speeds_meters_per_second(speed);
    }
  } else if (const auto* zone = std::get_if<Zone>(&feature.kind)) {
    auto* written = message.mutable_zone();
    for (const auto& ring : zone->rings) {
      write_points(ring, *written->add_rings());
    }
  } else {
    refuse(field, "is empty; give a Point, a Route or a Zone");
  }
}

}  // namespace

v1::MatchRequest match_request(const Source& sketch, const Source& map,
                               const MatchOptions& options) {
  v1::MatchRequest request;
  write_common(sketch, map, options, request);
  if (options.alternatives) {
    request.set_alternatives(*options.alternatives);
  }
  request.set_request_id(checked_text(options.request_id, "request_id"));
  request.set_keep_running(options.keep_running);
  request.set_priority(static_cast<v1::Priority>(options.priority));
  return request;
}

v1::SegmentRequest segment_request(const Source& source, const SegmentOptions& options) {
  v1::SegmentRequest request;
  write_segmenting(source, options, request);
  request.set_include_map(options.include_map);
  return request;
}

v1::PutSceneRequest put_scene_request(const Source& source, const PutOptions& options) {
  v1::PutSceneRequest request;
  write_segmenting(source, options, request);
  request.set_title(checked_text(options.title, "title"));
  return request;
}

v1::UpdateSceneRequest update_scene_request(const std::string& name, const ObjectLabels& labels,
                                            const std::optional<std::string>& title) {
  v1::UpdateSceneRequest request;
  request.set_name(checked_text(name, "name"));
  if (title) {
    request.set_title(checked_text(*title, "title"));
  }
  for (const auto& [object, label] : labels) {
    const auto field = numbered("labels", request.labels_size());
    auto* message = request.add_labels();
    message->set_object(object);
    message->set_label(checked_text(label, field));
  }
  return request;
}

v1::TransferRequest transfer_request(const Source& sketch, const Source& map,
                                     const std::vector<Feature>& features,
                                     const TransferOptions& options) {
  refuse_for_transfer(options.alternatives.has_value(), "alternatives");
  refuse_for_transfer(!options.request_id.empty(), "request_id");
  refuse_for_transfer(options.keep_running, "keep_running");
  refuse_for_transfer(options.priority != Priority::unspecified, "priority");
  v1::TransferRequest request;
  write_common(sketch, map, options, request);
  for (const auto& [sketched, mapped] : options.object_map) {
    auto* pair = request.add_object_map();
    pair->set_sketch_object(sketched);
    pair->set_map_object(mapped);
  }
  request.set_direction(static_cast<v1::TransferDirection>(options.direction));
  for (const auto& feature : features) {
    const auto field = numbered("features", request.features_size());
    write(feature, *request.add_features(), field);
  }
  if (options.y_axis == YAxis::down) {
    request.set_y_axis(v1::Y_AXIS_DOWN);
  }
  if (options.radius) {
    request.set_radius(*options.radius);
  }
  request.set_allow_unknown(options.allow_unknown);
  return request;
}

}  // namespace sketchmatch::detail
