#include "encoding.hpp"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/duration.pb.h>
#include <google/protobuf/struct.pb.h>
#include <google/protobuf/timestamp.pb.h>

#include <cmath>
#include <map>
#include <sketchmatch/raw.hpp>
#include <sstream>
#include <stdexcept>
#include <type_traits>

namespace sketchmatch::test {

namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

/// The fields that the client writes into requests, by message; those of answers are below.
const std::map<std::string, std::string> kWritten{
    {"MatchRequest",
     "sketch map pipeline seed time_budget weights alternatives allow_unmatched unmatched_price "
     "pins "
     "synonyms request_id keep_running priority"},
    {"TransferRequest",
     "sketch map pipeline seed time_budget weights allow_unmatched unmatched_price pins synonyms "
     "object_map direction features y_axis radius allow_unknown"},
    {"Pin", "sketch_object map_object excluded"},
    {"ObjectReference", "index label"},
    {"Synonyms", "labels"},
    {"WatchMatchRequest", "match_id after"},
    {"GetMatchRequest", "match_id"},
    {"CancelMatchRequest", "match_id"},
    {"SegmentRequest", "source segmenter profile"},
    {"PutSceneRequest", "source segmenter profile"},
    {"GetSceneRequest", "name include_source"},
    {"ListScenesRequest", "page_token"},
    {"UpdateSceneRequest", "name labels"},
    {"ObjectLabel", "object label"},
    {"DeleteSceneRequest", "name"},
    {"Source", "stroke_set polygon_set occupancy_grid image map_server_map file stored_scene"},
    {"StrokeSet", "strokes y_axis"},
    {"Stroke", "points label"},
    {"StrokePoint", "x y time_seconds"},
    {"PolygonSet", "polygons y_axis"},
    {"LabelledPolygon", "rings label certainty"},
    {"OccupancyGrid", "rows columns resolution_meters origin cells"},
    {"Pose", "x_meters y_meters yaw_radians"},
    {"EncodedImage", "data"},
    {"MapServerMap", "yaml image objects"},
    {"EncodedFile", "name data part"},
};

template <typename Kind, typename Variant>
std::optional<Kind> if_it_is(const Variant& variant) {
  const auto* found = std::get_if<Kind>(&variant);
  return found == nullptr ? std::nullopt : std::optional(*found);
}

#define FIELD(name) visit(#name, value.name)

/// The fields that the client reads, by value: `of` names each of them to a visitor.
struct Fields {
  template <typename Visit>
  static void of(const AlgorithmSelection& value, const Visit& visit) {
    FIELD(name);
    FIELD(parameters);
  }

  template <typename Visit>
  static void of(const Pipeline& value, const Visit& visit) {
    FIELD(sketch_segmenter);
    FIELD(map_segmenter);
    FIELD(histogram);
    FIELD(similarity);
    FIELD(searcher);
    FIELD(judge);
    FIELD(profile);
  }

  template <typename Visit>
  static void of(const Weights& value, const Visit& visit) {
    FIELD(similarity);
    FIELD(rotation);
    FIELD(dilation);
    FIELD(shape);
    FIELD(size);
    FIELD(distance);
  }

  template <typename Visit>
  static void of(const Point& value, const Visit& visit) {
    FIELD(x);
    FIELD(y);
  }

  template <typename Visit>
  static void of(const Ring& value, const Visit& visit) {
    visit("points", value);
  }

  template <typename Visit>
  static void of(const SceneObject& value, const Visit& visit) {
    FIELD(rings);
    FIELD(label);
    FIELD(area);
    FIELD(centroid);
    FIELD(certainty);
  }

  template <typename Visit>
  static void of(const Scene& value, const Visit& visit) {
    FIELD(objects);
  }

  template <typename Visit>
  static void of(const MatchAccepted& value, const Visit& visit) {
    FIELD(match_id);
    FIELD(seed);
    FIELD(pipeline);
    FIELD(weights);
    FIELD(time_budget);
    FIELD(unmatched_price);
  }

  template <typename Visit>
  static void of(const MatchScenes& value, const Visit& visit) {
    FIELD(sketch);
    FIELD(map);
    FIELD(sketch_warnings);
    FIELD(map_warnings);
    FIELD(sketch_route);
  }

  template <typename Visit>
  static void of(const ObjectRelation& value, const Visit& visit) {
    FIELD(reference_object);
    FIELD(phrase);
    FIELD(degree);
  }

  template <typename Visit>
  static void of(const ObjectMatch& value, const Visit& visit) {
    FIELD(sketch_object);
    FIELD(map_object);
    FIELD(sketch_label);
    FIELD(map_label);
    FIELD(confidence);
    FIELD(margin);
    FIELD(relation);
    FIELD(probability);
  }

  template <typename Visit>
  static void of(const Progress& value, const Visit& visit) {
    FIELD(phase);
    FIELD(fraction);
    FIELD(iteration);
    FIELD(evaluations);
    FIELD(confidence);
    FIELD(upper_bound);
    FIELD(object_matches);
    FIELD(elapsed);
  }

  template <typename Visit>
  static void of(const FmapConfidence& value, const Visit& visit) {
    FIELD(total);
    FIELD(similarity);
    FIELD(rotation);
    FIELD(dilation);
    FIELD(shape);
    FIELD(size);
  }

  template <typename Visit>
  static void of(const ObjectPair& value, const Visit& visit) {
    FIELD(first);
    FIELD(second);
  }

  template <typename Visit>
  static void of(const FmapEntry& value, const Visit& visit) {
    FIELD(sketch_pair);
    FIELD(map_pair);
    FIELD(similarity);
    FIELD(rotation_radians);
    FIELD(dilation);
  }

  template <typename Visit>
  static void of(const AlternativeMap& value, const Visit& visit) {
    FIELD(object_matches);
    FIELD(fmap_confidence);
    FIELD(omap_confidence);
    FIELD(probability);
  }

  template <typename Visit>
  static void of(const Ambiguity& value, const Visit& visit) {
    FIELD(maps);
    FIELD(alternatives);
    FIELD(deciding_sketch_objects);
  }

  template <typename Visit>
  static void of(const ObjectGroup& value, const Visit& visit) {
    FIELD(sketch_objects);
    FIELD(map_objects);
    FIELD(probability);
  }

  template <typename Visit>
  static void of(const MatchStatistics& value, const Visit& visit) {
    FIELD(iterations);
    FIELD(evaluations);
    FIELD(segment_elapsed);
    FIELD(describe_elapsed);
    FIELD(relate_elapsed);
    FIELD(search_elapsed);
    FIELD(total_elapsed);
  }

  template <typename Visit>
  static void of(const MatchResult& value, const Visit& visit) {
    FIELD(match_id);
    FIELD(seed);
    FIELD(outcome);
    FIELD(object_matches);
    FIELD(unmatched_sketch_objects);
    FIELD(unmatched_sketch_probabilities);
    FIELD(unmatched_map_objects);
    FIELD(omap_confidence);
    FIELD(fmap_confidence);
    FIELD(upper_bound);
    FIELD(fmap_entries);
    FIELD(rotation_radians);
    FIELD(scale);
    FIELD(statistics);
    FIELD(alternatives);
    FIELD(search_note);
    FIELD(probability);
    FIELD(place_probability);
    FIELD(ambiguity);
    FIELD(provisional);
    FIELD(object_groups);
  }

  template <typename Visit>
  static void of(const MatchSummary& value, const Visit& visit) {
    FIELD(match_id);
    FIELD(request_id);
    FIELD(state);
    FIELD(created_at);
    FIELD(ended_at);
    FIELD(outcome);
    FIELD(last_event);
    FIELD(error_message);
    FIELD(error_reason);
  }

  template <typename Visit>
  static void of(const Segmentation& value, const Visit& visit) {
    FIELD(scene);
    FIELD(warnings);
    FIELD(segmenter);
    FIELD(route);
  }

  template <typename Visit>
  static void of(const StoredScene& value, const Visit& visit) {
    FIELD(name);
    FIELD(scene);
    FIELD(warnings);
    FIELD(segmenter);
    FIELD(route);
  }

  template <typename Visit>
  static void of(const PutScene& value, const Visit& visit) {
    FIELD(stored_scene);
    FIELD(created);
  }

  template <typename Visit>
  static void of(const GotScene& value, const Visit& visit) {
    FIELD(stored_scene);
    FIELD(source);
  }

  template <typename Visit>
  static void of(const SceneSummary& value, const Visit& visit) {
    FIELD(name);
    FIELD(object_count);
    FIELD(labels);
    FIELD(put_time);
  }

  template <typename Visit>
  static void of(const Route& value, const Visit& visit) {
    FIELD(points);
    FIELD(speeds_meters_per_second);
  }

  template <typename Visit>
  static void of(const Zone& value, const Visit& visit) {
    FIELD(rings);
  }

  template <typename Visit>
  static void of(const Feature& value, const Visit& visit) {
    FIELD(name);
    visit("point", if_it_is<Point>(value.kind));
    visit("route", if_it_is<Route>(value.kind));
    visit("zone", if_it_is<Zone>(value.kind));
  }

  template <typename Visit>
  static void of(const FeatureChange& value, const Visit& visit) {
    FIELD(reason);
    FIELD(first_point);
    FIELD(last_point);
    FIELD(sentence);
  }

  template <typename Visit>
  static void of(const CarriedPoints& value, const Visit& visit) {
    FIELD(deviations);
    FIELD(sources);
  }

  template <typename Visit>
  static void of(const CarriedFeature& value, const Visit& visit) {
    FIELD(feature);
    FIELD(lines);
    FIELD(changes);
    FIELD(drawn);
  }

  template <typename Visit>
  static void of(const Warp& value, const Visit& visit) {
    FIELD(kind);
    FIELD(rotation_radians);
    FIELD(scale);
    FIELD(residual);
    FIELD(weights);
  }

  template <typename Visit>
  static void of(const Partners& value, const Visit& visit) {
    FIELD(sketch_object);
    FIELD(map_object);
  }

  template <typename Visit>
  static void of(const Transfer& value, const Visit& visit) {
    FIELD(features);
    FIELD(warp);
    visit("object_map", value.partners);
    FIELD(scenes);
    FIELD(match);
  }

  template <typename Visit>
  static void of(const Algorithm& value, const Visit& visit) {
    FIELD(kind);
    FIELD(name);
    FIELD(summary);
    FIELD(description);
    FIELD(distribution);
    FIELD(distribution_version);
    FIELD(parameters_schema);
    FIELD(is_default);
    FIELD(source_kinds);
    FIELD(source);
  }

  template <typename Visit>
  static void of(const Plugin& value, const Visit& visit) {
    FIELD(distribution);
    FIELD(version);
    FIELD(state);
    FIELD(reason);
  }

  template <typename Visit>
  static void of(const Profile& value, const Visit& visit) {
    FIELD(name);
    FIELD(summary);
    FIELD(pipeline);
    FIELD(is_default);
    FIELD(weights);
    FIELD(allow_unmatched);
  }

  template <typename Visit>
  static void of(const FileReader& value, const Visit& visit) {
    FIELD(name);
    FIELD(summary);
    FIELD(suffixes);
    FIELD(json_keys);
    FIELD(source_kind);
    FIELD(distribution);
    FIELD(distribution_version);
  }

  template <typename Visit>
  static void of(const Catalogue& value, const Visit& visit) {
    FIELD(algorithms);
    FIELD(plugins);
    FIELD(profiles);
    FIELD(readers);
  }

  template <typename Visit>
  static void of(const ServerLimits& value, const Visit& visit) {
    FIELD(max_request_bytes);
    FIELD(max_objects);
    FIELD(max_concurrent_matches);
    FIELD(max_time_budget);
    FIELD(max_waiting);
    FIELD(max_wait);
    FIELD(default_time_budget);
    FIELD(max_matches_per_caller);
    FIELD(max_requests_per_minute);
    FIELD(max_comparisons);
    FIELD(max_candidates);
  }

  template <typename Visit>
  static void of(const ServerInfo& value, const Visit& visit) {
    FIELD(version);
    FIELD(api_version);
    FIELD(plugin_api_version);
    FIELD(limits);
    FIELD(uptime);
    FIELD(keeps_scenes);
  }
};

template <typename Value>
constexpr bool kIsPlain =
    std::is_arithmetic_v<Value> || std::is_enum_v<Value> || std::is_same_v<Value, std::string>;

google::protobuf::Value as_json_value(const Value& value) {
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
      *message.mutable_list_value()->add_values() = as_json_value(each);
    }
  } else if (std::holds_alternative<Value::Object>(kind)) {
    message.mutable_struct_value();
    for (const auto& [name, each] : std::get<Value::Object>(kind)) {
      (*message.mutable_struct_value()->mutable_fields())[name] = as_json_value(each);
    }
  } else {
    message.set_null_value(google::protobuf::NULL_VALUE);
  }
  return message;
}

/// Writes fields into a message, by name.
class Writer {
 public:
  explicit Writer(Message& message) : message_(message) {}

  template <typename Value>
  void operator()(const char* name, const Value& value) const {
    put(*message_.GetDescriptor()->FindFieldByName(name), value);
  }

 private:
  template <typename Value>
  void put(const FieldDescriptor& field, const std::optional<Value>& value) const {
    if (value) {
      put(field, *value);
      if constexpr (!kIsPlain<Value>) {
        message_.GetReflection()->MutableMessage(&message_, &field);  // an empty one, too
      }
    }
  }

  template <typename Value>
  void put(const FieldDescriptor& field, const std::vector<Value>& values) const {
    for (const auto& value : values) {
      if constexpr (kIsPlain<Value>) {
        add(field, value);
      } else {
        write(value, *message_.GetReflection()->AddMessage(&message_, &field));
      }
    }
  }

  template <typename Value>
  void put(const FieldDescriptor& field, const Value& value) const {
    const auto* reflection = message_.GetReflection();
    if constexpr (std::is_enum_v<Value>) {
      reflection->SetEnumValue(&message_, &field, static_cast<int>(value));
    } else if constexpr (std::is_same_v<Value, bool>) {
      reflection->SetBool(&message_, &field, value);
    } else if constexpr (std::is_same_v<Value, double>) {
      reflection->SetDouble(&message_, &field, value);
    } else if constexpr (std::is_same_v<Value, std::uint32_t>) {
      reflection->SetUInt32(&message_, &field, value);
    } else if constexpr (std::is_same_v<Value, std::uint64_t>) {
      reflection->SetUInt64(&message_, &field, value);
    } else if constexpr (std::is_same_v<Value, std::string>) {
      reflection->SetString(&message_, &field, value);
    } else {
      auto* part = reflection->MutableMessage(&message_, &field);
      write(value, *part);
      if (part->ByteSizeLong() == 0) {
        reflection->ClearField(&message_, &field);
      }
    }
  }

  template <typename Value>
  void add(const FieldDescriptor& field, const Value& value) const {
    const auto* reflection = message_.GetReflection();
    if constexpr (std::is_enum_v<Value>) {
      reflection->AddEnumValue(&message_, &field, static_cast<int>(value));
    } else if constexpr (std::is_same_v<Value, double>) {
      reflection->AddDouble(&message_, &field, value);
    } else if constexpr (std::is_same_v<Value, std::uint32_t>) {
      reflection->AddUInt32(&message_, &field, value);
    } else {
      reflection->AddString(&message_, &field, value);
    }
  }

  static void write(Seconds value, Message& message) {
    google::protobuf::Duration duration;
    duration.set_seconds(static_cast<std::int64_t>(std::floor(value.count())));
    duration.set_nanos(
        static_cast<std::int32_t>((value.count() - std::floor(value.count())) * 1e9 + 0.5));
    message.CopyFrom(duration);
  }

  static void write(std::chrono::system_clock::time_point value, Message& message) {
    constexpr std::int64_t kNanos = 1'000'000'000;
    const auto count =
        std::chrono::duration_cast<std::chrono::nanoseconds>(value.time_since_epoch()).count();
    google::protobuf::Timestamp timestamp;
    timestamp.set_seconds(count / kNanos);
    timestamp.set_nanos(static_cast<std::int32_t>(count % kNanos));
    message.CopyFrom(timestamp);
  }

  static void write(const Parameters& value, Message& message) {
    message.CopyFrom(as_json_value(Value(value)).struct_value());
  }

  static void write(const Source& value, Message& message) { message.CopyFrom(value.message()); }

  template <typename Value>
  static void write(const Value& value, Message& message) {
    Fields::of(value, Writer(message));
  }

  Message& message_;
};

/// Collects the full names of fields, those of the messages within too.
class Collector {
 public:
  Collector(const Descriptor& described, std::set<std::string>& names)
      : described_(described), names_(names) {}

  template <typename Value>
  void operator()(const char* name, const Value& value) const {
    const auto* field = described_.FindFieldByName(name);
    if (field == nullptr) {
      throw std::logic_error(described_.full_name() + " has no field " + name);
    }
    if (names_.insert(field->full_name()).second) {
      within(field->message_type(), value);
    }
  }

 private:
  template <typename Value>
  void within(const Descriptor* described, const std::optional<Value>& value) const {
    if constexpr (!std::is_same_v<Value, Source>) {
      within(described, value.value_or(Value{}));
    }
  }

  template <typename Value>
  void within(const Descriptor* described, const std::vector<Value>& /*values*/) const {
    within(described, Value{});
  }

  void within(const Descriptor* described, const Ring& value) const {
    const bool is_ring = described->name() == "Ring";
    if (is_ring) {
      Fields::of(value, Collector(*described, names_));
    } else {
      within(described, Point{});
    }
  }

  template <typename Value>
  void within(const Descriptor* described, const Value& value) const {
    if constexpr (!kIsPlain<Value> && !std::is_same_v<Value, Seconds> &&
                  !std::is_same_v<Value, std::chrono::system_clock::time_point> &&
                  !std::is_same_v<Value, Parameters>) {
      Fields::of(value, Collector(*described, names_));
    }
  }

  const Descriptor& described_;
  std::set<std::string>& names_;
};

template <typename Type, typename Value>
void collect(std::set<std::string>& names, const Value& value = {}) {
  Fields::of(value, Collector(*Type::descriptor(), names));
}

/// The full names of all fields that the client knows.
const std::set<std::string>& known_fields() {
  static const std::set<std::string> known = [] {
    std::set<std::string> names;
    for (const auto& [type, fields] : kWritten) {
      std::istringstream words(fields);
      for (std::string word; words >> word;) {
        const auto name = "sketchmatch.v1." + type + "." + word;
        if (google::protobuf::DescriptorPool::generated_pool()->FindFieldByName(name) == nullptr) {
          throw std::logic_error("the contract has no field " + name);
        }
        names.insert(name);
      }
    }
    collect<v1::MatchAccepted, MatchAccepted>(names);
    collect<v1::MatchScenes, MatchScenes>(names);
    collect<v1::MatchProgress, Progress>(names);
    collect<v1::MatchResult, MatchResult>(names);
    collect<v1::MatchSummary, MatchSummary>(names);
    collect<v1::SegmentResponse, Segmentation>(names);
    collect<v1::PutSceneResponse, PutScene>(names);
    collect<v1::GetSceneResponse, GotScene>(names);
    collect<v1::SceneSummary, SceneSummary>(names);
    collect<v1::TransferResponse, Transfer>(names);
    collect<v1::ListAlgorithmsResponse, Catalogue>(names);
    collect<v1::GetServerInfoResponse, ServerInfo>(names);
    return names;
  }();
  return known;
}

void forget_unknown(Message& message, std::set<std::string>& forgotten) {
  if (message.GetDescriptor()->file()->package() != "sketchmatch.v1") {
    return;  // a Struct or a Duration
  }
  const auto* reflection = message.GetReflection();
  std::vector<const FieldDescriptor*> fields;
  reflection->ListFields(message, &fields);
  for (const auto* field : fields) {
    if (known_fields().count(field->full_name()) == 0) {
      forgotten.insert(field->full_name());
      reflection->ClearField(&message, field);
    } else if (field->message_type() == nullptr) {
      continue;
    } else if (field->is_repeated()) {
      for (int k = 0; k < reflection->FieldSize(message, field); ++k) {
        forget_unknown(*reflection->MutableRepeatedMessage(&message, field, k), forgotten);
      }
    } else {
      forget_unknown(*reflection->MutableMessage(&message, field), forgotten);
    }
  }
}

template <typename Value>
void written(const Value& value, Message& message) {
  Fields::of(value, Writer(message));
}

}  // namespace

void encode(const MatchAccepted& value, Message& message) { written(value, message); }
void encode(const MatchScenes& value, Message& message) { written(value, message); }
void encode(const Progress& value, Message& message) { written(value, message); }
void encode(const MatchResult& value, Message& message) { written(value, message); }
void encode(const MatchSummary& value, Message& message) { written(value, message); }
void encode(const Segmentation& value, Message& message) { written(value, message); }
void encode(const StoredScene& value, Message& message) { written(value, message); }
void encode(const PutScene& value, Message& message) { written(value, message); }
void encode(const GotScene& value, Message& message) { written(value, message); }
void encode(const SceneSummary& value, Message& message) { written(value, message); }
void encode(const Transfer& value, Message& message) { written(value, message); }
void encode(const Catalogue& value, Message& message) { written(value, message); }
void encode(const ServerInfo& value, Message& message) { written(value, message); }

std::set<std::string> forget_unknown(Message& message) {
  std::set<std::string> forgotten;
  forget_unknown(message, forgotten);
  return forgotten;
}

}  // namespace sketchmatch::test
