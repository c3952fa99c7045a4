#include "golden.hpp"

#include <google/protobuf/text_format.h>
#include <google/protobuf/util/json_util.h>

#include <fstream>
#include <iterator>
#include <stdexcept>

namespace sketchmatch::test {

std::string golden_folder() { return SKETCHMATCH_GOLDEN_DIR; }

void read_golden(const std::string& name, google::protobuf::Message& message) {
  std::ifstream file(golden_folder() + "/" + name + ".json");
  const std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  const auto status = google::protobuf::util::JsonStringToMessage(text, &message);
  if (!file.is_open() || !status.ok()) {
    throw std::runtime_error("golden message " + name + ": " + std::string(status.message()));
  }
}

std::string as_text(const google::protobuf::Message& message) {
  std::string text;
  google::protobuf::TextFormat::PrintToString(message, &text);
  return text;
}

}  // namespace sketchmatch::test
