/// @file
/// Golden messages: what goes over the wire, written by hand.
#pragma once

#include <google/protobuf/message.h>

#include <memory>
#include <set>
#include <string>

namespace sketchmatch::test {

/// Where the golden messages are.
std::string golden_folder();

/// Reads a golden message; its name begins with that of its type.
void read_golden(const std::string& name, google::protobuf::Message& message);

template <typename Message>
Message golden(const std::string& name) {
  Message message;
  read_golden(name, message);
  return message;
}

/// Returns the names of all golden messages.
std::set<std::string> golden_names();

/// Returns a golden message, whatever its type.
/// @throws std::runtime_error If the headers of the raw stubs have no such type.
std::unique_ptr<google::protobuf::Message> any_golden(const std::string& name);

/// Returns a message in protobuf's text format, in which equal messages are equal.
std::string as_text(const google::protobuf::Message& message);

}  // namespace sketchmatch::test
