#include "decoding.hpp"

#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "fields.hpp"

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

/// Reads values from messages.
class Reader {
 public:
  template <typename Value, typename Message>
  static Value value_of(const Message& message) {
    Value value{};
    into(value, message);
    return value;
  }

 private:
  template <typename Value, typename Message>
  static void into(Value& value, const Message& message) {
    if constexpr (std::is_arithmetic_v<Value> || std::is_enum_v<Value> ||
                  std::is_same_v<Value, std::string>) {
      value = static_cast<Value>(message);
    } else {
      for_each_field<Value>([&](const auto& field) {
        if constexpr (std::is_invocable_v<decltype(field.has), const Message&>) {
          if (!field.has(message)) {
            return;
          }
        }
        auto&& member = field.member(value);
        into(member, field.get(message));
      });
    }
  }

  template <typename Value, typename Message>
  static void into(std::optional<Value>& value, const Message& message) {
    into(value.emplace(), message);
  }

  template <typename Kind, typename Variant, typename Message>
  static void into(OneOf<Kind, Variant>& value, const Message& message) {
    into(value.variant.template emplace<Kind>(), message);
  }

  template <typename Value, typename Messages>
  static void into(std::vector<Value>& values, const Messages& messages) {
    values.reserve(static_cast<std::size_t>(messages.size()));
    for (const auto& each : messages) {
      into(values.emplace_back(), each);
    }
  }

  static void into(Ring& ring, const v1::Ring& message) { into(ring, message.points()); }

  static void into(std::optional<Source>& source, const v1::Source& message) {
    source.emplace(message);
  }

  static void into(Seconds& time, const google::protobuf::Duration& message) {
    time = std::chrono::seconds(message.seconds()) +
           Seconds(std::chrono::nanoseconds(message.nanos()));
  }

  using Time = std::chrono::system_clock::time_point;
  static void into(Time& time, const google::protobuf::Timestamp& message) {
    time = Time(std::chrono::duration_cast<Time::duration>(
        std::chrono::seconds(message.seconds()) + std::chrono::nanoseconds(message.nanos())));
  }

  static void into(Parameters& parameters, const google::protobuf::Struct& message) {
    for (const auto& [name, value] : message.fields()) {
      parameters.emplace(name, json_value_of(value));
    }
  }

  static Value json_value_of(const google::protobuf::Value& message) {
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
          list.push_back(json_value_of(each));
        }
        return list;
      }
      case google::protobuf::Value::kStructValue:
        return value_of<Parameters>(message.struct_value());
      default:
        return nullptr;
    }
  }
};

}  // namespace

std::optional<MatchEvent> decoded(const v1::MatchResponse& message) {
  switch (message.event_case()) {
    case v1::MatchResponse::kAccepted:
      return Reader::value_of<MatchAccepted>(message.accepted());
    case v1::MatchResponse::kScenes:
      return Reader::value_of<MatchScenes>(message.scenes());
    case v1::MatchResponse::kProgress:
      return Reader::value_of<Progress>(message.progress());
    case v1::MatchResponse::kResult:
      return Reader::value_of<MatchResult>(message.result());
    default:
      return std::nullopt;
  }
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

MatchSummary decoded(const v1::MatchSummary& message) {
  return Reader::value_of<MatchSummary>(message);
}

Segmentation decoded(const v1::SegmentResponse& message) {
  return Reader::value_of<Segmentation>(message);
}

StoredScene decoded(const v1::StoredScene& message) {
  return Reader::value_of<StoredScene>(message);
}

PutScene decoded(const v1::PutSceneResponse& message) {
  return Reader::value_of<PutScene>(message);
}

GotScene decoded(const v1::GetSceneResponse& message) {
  return Reader::value_of<GotScene>(message);
}

SceneSummary decoded(const v1::SceneSummary& message) {
  return Reader::value_of<SceneSummary>(message);
}

Transfer decoded(const v1::TransferResponse& message) {
  return Reader::value_of<Transfer>(message);
}

Catalogue decoded(const v1::ListAlgorithmsResponse& message) {
  return Reader::value_of<Catalogue>(message);
}

ServerInfo decoded(const v1::GetServerInfoResponse& message) {
  return Reader::value_of<ServerInfo>(message);
}

}  // namespace detail
}  // namespace sketchmatch
