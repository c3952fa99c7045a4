#include "map_files.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <system_error>

#include "text.hpp"

namespace sketchmatch::detail {

namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostBytes = std::size_t{64} * 1024;
constexpr std::size_t kMostFiles = 200;  // a folder of more is no map's
constexpr std::size_t kMostNamed = 5;
constexpr std::size_t kMostObjectBytes = std::size_t{16} * 1024 * 1024;
constexpr const char* kObjects = ".objects.geojson";
constexpr const char* kRemedy = "give the file that map_server saved";
constexpr std::array kYamls{".yaml", ".yml"};
constexpr std::array kPictures{".bmp", ".gif", ".jpeg", ".jpg", ".pbm",  ".pgm",
                               ".png", ".pnm", ".ppm",  ".tif", ".tiff", ".webp"};

template <std::size_t N>
bool has_suffix(const fs::path& path, const std::array<const char*, N>& suffixes) {
  const std::string suffix = lowered(path.extension().string());
  return std::find(suffixes.begin(), suffixes.end(), suffix) != suffixes.end();
}

bool is_file(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

YAML::Node document_of(const std::string& text) {
  if (text.size() > kMostBytes) {
    throw MapFileError("has " + std::to_string(text.size()) + " bytes, more than the limit of " +
                           std::to_string(kMostBytes / 1024) + " KiB for a map's YAML; " + kRemedy,
                       "LIMIT_EXCEEDED");
  }
  YAML::Node document;
  try {
    document = YAML::Load(text);
  } catch (const YAML::Exception& error) {
    std::string where;
    if (!error.mark.is_null()) {
      where = " (line " + std::to_string(error.mark.line + 1) + ")";
    }
    throw MapFileError("is not YAML" + where + "; " + kRemedy, "INVALID_GRID");
  }
  if (!document.IsMap()) {
    throw MapFileError(std::string("is not a list of keys and values; ") + kRemedy, "INVALID_GRID");
  }
  return document;
}

bool is_name(const std::string& text) {
  return !stripped(text).empty() && text.find('\0') == std::string::npos;
}

std::vector<std::string> images_in(const YAML::Node& document) {
  std::vector<std::string> names;
  for (const auto& entry : document) {
    if (!entry.first.IsScalar() || entry.first.Scalar() != "image") {
      continue;
    }
    if (entry.second.IsScalar() && is_name(entry.second.Scalar())) {
      names.push_back(entry.second.Scalar());
    } else if (names.empty()) {
      return {};  // the first is what counts
    }
  }
  names.erase(std::unique(names.begin(), names.end()), names.end());
  return names;
}

/// Returns the picture names in a YAML file that describes a map; none for other files.
std::vector<std::string> images_of_map(const fs::path& file) {
  std::error_code ignored;
  if (!is_file(file) || fs::file_size(file, ignored) > kMostBytes) {
    return {};
  }
  try {
    const YAML::Node document = document_of(decoded_yaml(read_bytes(file)));
    return document["resolution"].IsDefined() ? images_in(document) : std::vector<std::string>();
  } catch (const std::exception&) {
    return {};
  }
}

std::vector<fs::path> yamls_in(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (has_suffix(entry.path(), kYamls)) {
      files.push_back(entry.path());
    }
  }
  std::sort(files.begin(), files.end());
  files.resize(std::min(files.size(), kMostFiles));
  return files;
}

std::string named(const std::vector<fs::path>& files) {
  std::string names;
  for (std::size_t k = 0; k < std::min(files.size(), kMostNamed); ++k) {
    names += (k == 0 ? "" : ", ") + files.at(k).filename().string();
  }
  return files.size() > kMostNamed ? names + ", …" : names;
}

fs::path yaml_in(const fs::path& folder) {
  std::vector<fs::path> found;
  try {
    for (const auto& file : yamls_in(folder)) {
      if (!images_of_map(file).empty()) {
        found.push_back(file);
      }
    }
  } catch (const fs::filesystem_error& error) {
    throw MapFileError("cannot be read (" + lowered(error.code().message()) +
                       "); check the folder's permissions");
  }
  if (found.empty()) {
    throw MapFileError("is a folder without a map; give the .yaml that map_server saved");
  }
  if (found.size() > 1) {
    throw MapFileError("is a folder with several maps; give one of them: " + named(found));
  }
  return found.front();
}

/// Returns the YAML file beside a picture that names it. Of several, the one with the name of the
/// picture is used.
fs::path yaml_of(const fs::path& picture) {
  std::vector<fs::path> found;
  std::error_code ignored;
  if (is_file(picture)) {
    const auto folder = picture.has_parent_path() ? picture.parent_path() : fs::path(".");
    for (const auto& file : yamls_in(folder)) {
      const auto images = images_of_map(file);
      if (!images.empty() && fs::equivalent(find_picture(file, images).path, picture, ignored)) {
        found.push_back(file);
      }
    }
  }
  if (found.empty()) {
    throw MapFileError("is a picture that no .yaml beside it names; give the map's .yaml");
  }
  const auto own = std::find_if(found.begin(), found.end(), [&](const fs::path& file) {
    return file.stem() == picture.stem();
  });
  if (found.size() > 1 && own == found.end()) {
    throw MapFileError("is the picture of several maps; give one of them: " + named(found));
  }
  return own == found.end() ? found.front() : *own;
}

}  // namespace

std::optional<fs::path> find_yaml(const fs::path& path) {
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) {
    return yaml_in(path);
  }
  if (has_suffix(path, kPictures)) {
    return yaml_of(path);
  }
  return std::nullopt;
}

std::string decoded_yaml(const std::string& bytes) {
  std::string text = starts_with(bytes, "\xEF\xBB\xBF") ? bytes.substr(3) : bytes;
  if (!is_utf8(text)) {
    throw MapFileError("is not UTF-8 text; save it as UTF-8");
  }
  return text;
}

std::vector<std::string> images_of(const std::string& text) { return images_in(document_of(text)); }

FoundFile find_picture(const fs::path& file, const std::vector<std::string>& images) {
  const auto folder = file.parent_path();
  const auto there = folder / images.front();
  if (is_file(there)) {
    if (images.size() == 1) {
      return {there, {}};
    }
    return {there,
            {file.filename().string() + " has image twice, and the first, " +
             there.filename().string() + ", was used"}};
  }
  for (const auto& image : images) {
    // A path from Windows has backslashes, which other systems take as letters.
    std::string name = stripped(image);
    name = name.substr(name.find_last_of("/\\") + 1);
    const auto beside = folder / (name.empty() ? image : name);
    if (is_file(beside)) {
      return {beside,
              {"the map's image " + images.front() + " does not exist, and " +
               beside.filename().string() + " beside " + file.filename().string() + " was used"}};
    }
  }
  return {there, {}};
}

std::optional<FoundObjects> find_objects(const fs::path& file) {
  const auto path = file.parent_path() / (file.stem().string() + kObjects);
  std::error_code ignored;
  if (!is_file(path) || fs::file_size(path, ignored) > kMostObjectBytes) {
    return std::nullopt;
  }
  try {
    return FoundObjects{decoded_yaml(read_bytes(path)),
                        "the objects are from " + path.filename().string() +
                            " beside the map, unless a segmenter is chosen"};
  } catch (const std::exception&) {
    return std::nullopt;
  }
}

}  // namespace sketchmatch::detail
