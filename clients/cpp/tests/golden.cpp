#include "golden.hpp"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/text_format.h>
#include <google/protobuf/util/json_util.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <sketchmatch/raw.hpp>
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

std::set<std::string> golden_names() {
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(golden_folder())) {
    if (entry.path().extension() == ".json") {
      names.insert(entry.path().stem().string());
    }
  }
  return names;
}

std::unique_ptr<google::protobuf::Message> any_golden(const std::string& name) {
  // What nobody names is not linked: one message of each service that the client does not wrap.
  static_cast<void>(v1::CreateSketchRequest().ByteSizeLong());
  const auto type = name.substr(0, name.find('.'));
  const auto full = (type == "Status" ? "google.rpc." : "sketchmatch.v1.") + type;
  const auto* described =
      google::protobuf::DescriptorPool::generated_pool()->FindMessageTypeByName(full);
  if (described == nullptr) {
    throw std::runtime_error("no type " + full + " for the golden message " + name +
                             "; include its service in raw.hpp, and name a message of it here");
  }
  auto* factory = google::protobuf::MessageFactory::generated_factory();
  std::unique_ptr<google::protobuf::Message> message(factory->GetPrototype(described)->New());
  read_golden(name, *message);
  return message;
}

std::string as_text(const google::protobuf::Message& message) {
  std::string text;
  google::protobuf::TextFormat::PrintToString(message, &text);
  return text;
}

}  // namespace sketchmatch::test
