/// @file
/// The two files of a robot's map: which they are, and what picture the YAML names.
///
/// ROS reads the YAML with yaml-cpp, too, so that both read it alike.
#pragma once

#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace sketchmatch::detail {

/// A map's files cannot be used as they are. `what()` follows the file's name in a sentence.
class MapFileError : public std::runtime_error {
 public:
  explicit MapFileError(const std::string& problem, std::string reason = "INVALID_FILE")
      : std::runtime_error(problem), reason_(std::move(reason)) {}

  [[nodiscard]] const std::string& reason() const noexcept { return reason_; }

 private:
  std::string reason_;
};

/// A file, and notes on how it was found.
struct FoundFile {
  std::filesystem::path path;
  std::vector<std::string> notes;
};

/// Returns the YAML file of a map, for the path of its picture or of a folder; nothing for other
/// paths.
/// @throws MapFileError If a folder holds no map, or several, or no YAML names a picture.
std::optional<std::filesystem::path> find_yaml(const std::filesystem::path& path);

/// Returns the text of a YAML file, without a byte order mark.
/// @throws MapFileError If it is not UTF-8.
std::string decoded_yaml(const std::string& bytes);

/// Returns the names of the picture; the first one is used.
/// @throws MapFileError If the text is not YAML with keys and values, or is too large.
std::vector<std::string> images_of(const std::string& text);

/// Returns the picture of a map. If it is not at the place that is named, as on another machine
/// than the one that saved it, one of that name beside the YAML file is used.
FoundFile find_picture(const std::filesystem::path& file, const std::vector<std::string>& images);

/// The corrected objects of a map, and a note on where they are from.
struct FoundObjects {
  std::string text;
  std::string note;
};

/// Returns the file with the corrected objects beside a map, or nothing if there is none or it
/// cannot be read. The server decides whether it is for this map.
std::optional<FoundObjects> find_objects(const std::filesystem::path& file);

}  // namespace sketchmatch::detail
