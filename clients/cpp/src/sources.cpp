#include <sketchmatch/v1/source.pb.h>

#include <cerrno>
#include <sketchmatch/errors.hpp>
#include <sketchmatch/sources.hpp>
#include <system_error>
#include <utility>

#include "map_files.hpp"
#include "points.hpp"
#include "text.hpp"

namespace sketchmatch {

Source::Source(const v1::Source& message, std::vector<std::string> notes)
    : message_(std::make_shared<const v1::Source>(message)), notes_(std::move(notes)) {}

namespace {

using detail::refuse;
using detail::written;

/// Returns the label of the thing with a number, or an empty text if there are no labels.
std::string label_of(const std::vector<std::string>& labels, std::size_t number) {
  if (labels.empty()) {
    return {};
  }
  return detail::checked_text(labels.at(number), "labels[" + std::to_string(number) + "]");
}

/// Throws if there is another number of values than of things.
void check_count(const std::string& field, std::size_t given, const char* of, std::size_t count,
                 const char* what) {
  if (given != 0 && given != count) {
    throw InvalidRequestError(field + " has " + std::to_string(given) + " " + of + " for " +
                                  std::to_string(count) + " " + what +
                                  "; give one for each, or none",
                              "INVALID_FIELD", field);
  }
}

void check_labels(const std::vector<std::string>& labels, std::size_t count, const char* what) {
  check_count("labels", labels.size(), "names", count, what);
}

std::string bytes_of(const std::filesystem::path& path, const std::string& field,
                     const std::string& origin = {}) {
  try {
    return detail::read_bytes(path);
  } catch (const std::system_error& error) {
    throw InvalidRequestError(field + " (" + detail::text_of(path) + origin + ") cannot be read: " +
                                  error.code().message() + "; check the path",
                              "INVALID_FILE", field);
  }
}

}  // namespace

namespace sources {

Source strokes(const std::vector<std::vector<StrokePoint>>& strokes,
               const std::vector<std::string>& labels, YAxis y_axis) {
  check_labels(labels, strokes.size(), "strokes");
  v1::Source source;
  auto* set = source.mutable_stroke_set();
  set->set_y_axis(written(y_axis));
  for (std::size_t k = 0; k < strokes.size(); ++k) {
    auto* stroke = set->add_strokes();
    stroke->set_label(label_of(labels, k));
    for (const auto& each : strokes.at(k)) {
      auto* point = stroke->add_points();
      point->set_x(each.x);
      point->set_y(each.y);
      if (each.seconds) {
        point->set_time_seconds(*each.seconds);
      }
    }
  }
  return Source(source);
}

Source polygons(const std::vector<Ring>& outlines, const std::vector<std::string>& labels,
                YAxis y_axis, const std::vector<std::optional<double>>& certainties) {
  std::vector<std::vector<Ring>> whole;
  whole.reserve(outlines.size());
  for (const auto& outline : outlines) {
    whole.push_back({outline});
  }
  return polygons_with_holes(whole, labels, y_axis, certainties);
}

Source polygons_with_holes(const std::vector<std::vector<Ring>>& polygons,
                           const std::vector<std::string>& labels, YAxis y_axis,
                           const std::vector<std::optional<double>>& certainties) {
  check_labels(labels, polygons.size(), "polygons");
  check_count("certainties", certainties.size(), "numbers", polygons.size(), "polygons");
  v1::Source source;
  auto* set = source.mutable_polygon_set();
  set->set_y_axis(written(y_axis));
  for (std::size_t k = 0; k < polygons.size(); ++k) {
    auto* polygon = set->add_polygons();
    polygon->set_label(label_of(labels, k));
    if (!certainties.empty() && certainties.at(k)) {
      polygon->set_certainty(*certainties.at(k));
    }
    for (const auto& ring : polygons.at(k)) {
      detail::write_points(ring, *polygon->add_rings());
    }
  }
  return Source(source);
}

Source stored_scene(const std::string& name) {
  v1::Source source;
  source.set_stored_scene(detail::checked_text(name, "stored_scene"));
  return Source(source);
}

Source occupancy_grid(const std::vector<std::int8_t>& cells, std::uint32_t columns,
                      double resolution, const Pose& origin) {
  if (columns == 0 || cells.empty() || cells.size() % columns != 0) {
    throw InvalidRequestError("occupancy_grid.columns is " + std::to_string(columns) + " for " +
                                  std::to_string(cells.size()) +
                                  " cells; give the number of cells in a row",
                              "INVALID_GRID", "occupancy_grid.columns");
  }
  v1::Source source;
  auto* grid = source.mutable_occupancy_grid();
  grid->set_rows(static_cast<std::uint32_t>(cells.size() / columns));
  grid->set_columns(columns);
  grid->set_resolution_meters(resolution);
  auto* pose = grid->mutable_origin();
  pose->set_x_meters(origin.x);
  pose->set_y_meters(origin.y);
  pose->set_yaw_radians(origin.yaw);
  grid->set_cells(cells.data(), cells.size());
  return Source(source);
}

Source map_server_map(const std::filesystem::path& path) {
  const std::string field = "map_server_map.yaml";
  try {
    const auto file = detail::find_yaml(path).value_or(path);
    const auto text = detail::decoded_yaml(bytes_of(file, field));
    const auto images = detail::images_of(text);
    if (images.empty()) {
      throw InvalidRequestError(
          field + " (" + detail::text_of(file) + ") names no picture; add a line `image: FILE`",
          "INVALID_FILE", field);
    }
    auto picture = detail::find_picture(file, images);
    v1::Source source;
    auto* map = source.mutable_map_server_map();
    map->set_yaml(text);
    map->set_image(bytes_of(picture.path, "map_server_map.image",
                            ", as " + detail::text_of(file) + " names it"));
    if (const auto objects = detail::find_objects(file)) {
      map->set_objects(objects->text);
      picture.notes.push_back(objects->note);
    }
    return Source(source, picture.notes);
  } catch (const detail::MapFileError& error) {
    throw InvalidRequestError(field + " (" + detail::text_of(path) + ") " + error.what(),
                              error.reason(), field);
  }
}

Source image(const std::filesystem::path& path) { return image_of(bytes_of(path, "image.data")); }

Source image_of(const std::string& bytes) {
  v1::Source source;
  source.mutable_image()->set_data(bytes);
  return Source(source);
}

Source file(const std::filesystem::path& path, const std::string& part, const std::string& name) {
  return file_of(bytes_of(path, "file"), name.empty() ? path.filename().string() : name, part);
}

Source file_of(const std::string& bytes, const std::string& name, const std::string& part) {
  if (name.empty()) {
    refuse("file.name", "is empty; give bytes a name whose ending tells what they are",
           "INVALID_FILE");
  }
  v1::Source source;
  auto* file = source.mutable_file();
  file->set_name(detail::checked_text(name, "file.name"));
  file->set_data(bytes);
  file->set_part(detail::checked_text(part, "file.part"));
  return Source(source);
}

}  // namespace sources
}  // namespace sketchmatch
