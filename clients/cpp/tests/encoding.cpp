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
#include <utility>
#include <variant>

#include "../src/fields.hpp"

namespace sketchmatch::test {

namespace {

using detail::for_each_field;
using detail::Of;
using detail::OneOf;
using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

/// The fields that the client writes into requests, by message; those of answers are below.
const std::map<std::string, std::string> kWritten{
    {"MatchRequest",
     "sketch map pipeline seed time_budget weights alternatives allow_unmatched unmatched_price "
     "pins synonyms request_id keep_running priority"},
    {"TransferRequest",
     "sketch map pipeline seed time_budget weights allow_unmatched unmatched_price pins synonyms "
     "object_map direction features y_axis radius allow_unknown"},
    {"Pin", "sketch_object map_object excluded"},
    {"ObjectReference", "index label"},
    {"Synonyms", "labels"},
    {"WatchMatchRequest", "match_id after"},
    {"GetMatchRequest", "match_id"},
    {"CancelMatchRequest", "match_id"},
    {"ListMatchesRequest", "page_token"},
    {"SegmentRequest", "source segmenter profile include_map"},
    {"PutSceneRequest", "source segmenter profile title"},
    {"GetSceneRequest", "name include_source"},
    {"ListScenesRequest", "page_token"},
    {"UpdateSceneRequest", "name labels title"},
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
  void write(const Value& value) const {
    for_each_field<Value>([&](const auto& field) {
      put(*message_.GetDescriptor()->FindFieldByName(field.name), field.member(value));
    });
  }

 private:
  template <typename Kind, typename Variant>
  void put(const FieldDescriptor& field, const OneOf<Kind, Variant>& value) const {
    if (const auto* held = std::get_if<Kind>(&value.variant)) {
      put(field, std::optional(*held));
    }
  }

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
        write_into(*message_.GetReflection()->AddMessage(&message_, &field), value);
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
      write_into(*part, value);
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

  static void write_into(Message& message, Seconds value) {
    google::protobuf::Duration duration;
    duration.set_seconds(static_cast<std::int64_t>(std::floor(value.count())));
    duration.set_nanos(
        static_cast<std::int32_t>((value.count() - std::floor(value.count())) * 1e9 + 0.5));
    message.CopyFrom(duration);
  }

  static void write_into(Message& message, std::chrono::system_clock::time_point value) {
    constexpr std::int64_t kNanos = 1'000'000'000;
    const auto count =
        std::chrono::duration_cast<std::chrono::nanoseconds>(value.time_since_epoch()).count();
    google::protobuf::Timestamp timestamp;
    timestamp.set_seconds(count / kNanos);
    timestamp.set_nanos(static_cast<std::int32_t>(count % kNanos));
    message.CopyFrom(timestamp);
  }

  static void write_into(Message& message, const Parameters& value) {
    message.CopyFrom(as_json_value(Value(value)).struct_value());
  }

  static void write_into(Message& message, const Source& value) {
    message.CopyFrom(value.message());
  }

  static void write_into(Message& message, const Ring& ring) {
    Writer(message).put(*message.GetDescriptor()->FindFieldByName("points"), ring);
  }

  template <typename Value>
  static void write_into(Message& message, const Value& value) {
    Writer(message).write(value);
  }

  Message& message_;
};

/// Collects the full names of fields, those of the messages within too.
class Collector {
 public:
  template <typename Value>
  void collect(const Descriptor& described) {
    for_each_field<Value>([&](const auto& field) {
      const auto* found = described.FindFieldByName(field.name);
      if (found == nullptr) {
        throw std::logic_error(described.full_name() + " has no field " + field.name);
      }
      if (names.insert(found->full_name()).second) {
        using Member = std::decay_t<decltype(field.member(std::declval<const Value&>()))>;
        within(Of<Member>(), found->message_type());
      }
    });
  }

  std::set<std::string> names;

 private:
  template <typename Value>
  void within(Of<std::optional<Value>> /*type*/, const Descriptor* described) {
    within(Of<Value>(), described);
  }

  template <typename Value>
  void within(Of<std::vector<Value>> /*type*/, const Descriptor* described) {
    within(Of<Value>(), described);
  }

  template <typename Kind, typename Variant>
  void within(Of<OneOf<Kind, Variant>> /*type*/, const Descriptor* described) {
    within(Of<Kind>(), described);
  }

  void within(Of<Ring> /*type*/, const Descriptor* described) {
    const auto* points = described->FindFieldByName("points");
    if (points != nullptr) {
      names.insert(points->full_name());
    }
    within(Of<Point>(), points == nullptr ? described : points->message_type());
  }

  void within(Of<Source> /*type*/, const Descriptor* /*described*/) {}
  void within(Of<Seconds> /*type*/, const Descriptor* /*described*/) {}
  void within(Of<std::chrono::system_clock::time_point> /*type*/, const Descriptor* /*of*/) {}
  void within(Of<Parameters> /*type*/, const Descriptor* /*described*/) {}

  template <typename Value>
  void within(Of<Value> /*type*/, const Descriptor* described) {
    if constexpr (!kIsPlain<Value>) {
      collect<Value>(*described);
    }
  }
};

/// The full names of all fields that the client knows.
const std::set<std::string>& known_fields() {
  static const std::set<std::string> known = [] {
    Collector collector;
    for (const auto& [type, fields] : kWritten) {
      std::istringstream words(fields);
      for (std::string word; words >> word;) {
        const auto name = "sketchmatch.v1." + type + "." + word;
        if (google::protobuf::DescriptorPool::generated_pool()->FindFieldByName(name) == nullptr) {
          throw std::logic_error("the contract has no field " + name);
        }
        collector.names.insert(name);
      }
    }
    collector.collect<MatchAccepted>(*v1::MatchAccepted::descriptor());
    collector.collect<MatchScenes>(*v1::MatchScenes::descriptor());
    collector.collect<Progress>(*v1::MatchProgress::descriptor());
    collector.collect<MatchResult>(*v1::MatchResult::descriptor());
    collector.collect<MatchSummary>(*v1::MatchSummary::descriptor());
    collector.collect<Segmentation>(*v1::SegmentResponse::descriptor());
    collector.collect<PutScene>(*v1::PutSceneResponse::descriptor());
    collector.collect<GotScene>(*v1::GetSceneResponse::descriptor());
    collector.collect<SceneSummary>(*v1::SceneSummary::descriptor());
    collector.collect<Transfer>(*v1::TransferResponse::descriptor());
    collector.collect<Catalogue>(*v1::ListAlgorithmsResponse::descriptor());
    collector.collect<ServerInfo>(*v1::GetServerInfoResponse::descriptor());
    return collector.names;
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

}  // namespace

template <typename Value>
void encode(const Value& value, Message& message) {
  Writer(message).write(value);
}

template void encode(const MatchAccepted& value, Message& message);
template void encode(const MatchScenes& value, Message& message);
template void encode(const Progress& value, Message& message);
template void encode(const MatchResult& value, Message& message);
template void encode(const MatchSummary& value, Message& message);
template void encode(const Segmentation& value, Message& message);
template void encode(const StoredScene& value, Message& message);
template void encode(const PutScene& value, Message& message);
template void encode(const GotScene& value, Message& message);
template void encode(const SceneSummary& value, Message& message);
template void encode(const Transfer& value, Message& message);
template void encode(const Catalogue& value, Message& message);
template void encode(const ServerInfo& value, Message& message);

std::set<std::string> forget_unknown(Message& message) {
  std::set<std::string> forgotten;
  forget_unknown(message, forgotten);
  return forgotten;
}

}  // namespace sketchmatch::test
