/// @file
/// From values back to messages: what a client lost on the way is missing in them.
///
/// A field of the contract that the client does not know yet is left out on both sides, so that the
/// contract may grow before the client does. One that it reads has its name in fields.hpp, and one
/// that it writes in encoding.cpp.
#pragma once

#include <google/protobuf/message.h>

#include <set>
#include <sketchmatch/sketchmatch.hpp>
#include <string>

namespace sketchmatch::test {

/// Writes a value into a message of the kind that it was decoded from.
template <typename Value>
void encode(const Value& value, google::protobuf::Message& message);

/// Takes out of a message what the client does not know, and returns the names of these fields.
std::set<std::string> forget_unknown(google::protobuf::Message& message);

}  // namespace sketchmatch::test
