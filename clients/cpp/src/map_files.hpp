/// @file
/// The two files of a robot's map: which they are, and what picture the YAML names.
///
/// ROS reads the YAML with yaml-cpp as well, so that both take it for the same.
#pragma once

#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace sketchmatch::detail {

/// A map's files cannot be used as they are. `what()` is to be read after the file's name.
class MapFileError : public std::runtime_error {
 public:
  explicit MapFileError(const std::string& problem, std::string reason = "INVALID_FILE")
      : std::runtime_error(problem), reason_(std::move(reason)) {}

  [[nodiscard]] const std::string& reason() const noexcept { return reason_; }

 private:
  std::string reason_;
};

/// A file, and what there is to say of how it was found.
struct FoundFile {
  std::filesystem::path path;
  std::vector<std::string> notes;
};

/// Returns the YAML file of a map: a path itself, or the one that names a picture, or the one in a
/// folder; none where a path is none of these.
/// @throws MapFileError If a folder holds no map, or several, or no YAML names a picture.
std::optional<std::filesystem::path> find_yaml(const std::filesystem::path& path);

/// Returns the text of a YAML file, without a byte order mark.
/// @throws MapFileError If it is no UTF-8.
std::string decoded_yaml(const std::string& bytes);

/// Returns the names of the picture; the first is what counts.
/// @throws MapFileError If the text is no YAML of keys and values, or too large.
std::vector<std::string> images_of(const std::string& text);

/// Returns the picture of a map. Where none is at the place that is named, as on another machine
/// than the one that saved it, one of that name beside the YAML file is taken.
FoundFile find_picture(const std::filesystem::path& file, const std::vector<std::string>& images);

/// What a map's objects are, and what there is to say of where that stands.
struct FoundObjects {
  std::string text;
  std::string note;
};

/// Returns the text of the file beside a map, with its name, that says what its objects are; none
/// where there is none, or it cannot be one. Whether it is of this map is the server's to say.
std::optional<FoundObjects> find_objects(const std::filesystem::path& file);

}  // namespace sketchmatch::detail
