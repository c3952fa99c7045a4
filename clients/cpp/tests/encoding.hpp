/// @file
/// From values back to messages: what a client lost on the way is missing in them.
///
/// A field of the contract that the client does not know yet is left out on both sides, so that the
/// contract may grow before the client does. One that it knows has its name in encoding.cpp.
#pragma once

#include <google/protobuf/message.h>

#include <set>
#include <sketchmatch/sketchmatch.hpp>
#include <string>

namespace sketchmatch::test {

/// Writes a value into a message of the kind that it was decoded from.
void encode(const MatchAccepted& value, google::protobuf::Message& message);
void encode(const MatchScenes& value, google::protobuf::Message& message);
void encode(const Progress& value, google::protobuf::Message& message);
void encode(const MatchResult& value, google::protobuf::Message& message);
void encode(const MatchSummary& value, google::protobuf::Message& message);
void encode(const Segmentation& value, google::protobuf::Message& message);
void encode(const StoredScene& value, google::protobuf::Message& message);
void encode(const PutScene& value, google::protobuf::Message& message);
void encode(const GotScene& value, google::protobuf::Message& message);
void encode(const SceneSummary& value, google::protobuf::Message& message);
void encode(const Transfer& value, google::protobuf::Message& message);
void encode(const Catalogue& value, google::protobuf::Message& message);
void encode(const ServerInfo& value, google::protobuf::Message& message);

/// Takes out of a message what the client does not know, and returns the names of these fields.
std::set<std::string> forget_unknown(google::protobuf::Message& message);

}  // namespace sketchmatch::test
