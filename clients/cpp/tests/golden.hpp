/// @file
/// Golden messages: what goes over the wire, written by hand.
#pragma once

#include <google/protobuf/message.h>

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

/// Returns a message in protobuf's text format, in which equal messages are equal.
std::string as_text(const google::protobuf::Message& message);

}  // namespace sketchmatch::test
