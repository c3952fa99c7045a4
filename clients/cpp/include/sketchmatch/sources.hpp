/// @file
/// Functions that make the sketches and maps that a client sends.
///
/// They check the form of what they are given. Whether strokes form objects, or a map has any, is
/// found by the server.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <sketchmatch/scene.hpp>
#include <string>
#include <vector>

namespace sketchmatch {

namespace v1 {
class Source;
}

/// A sketch or a map in one of the forms that servers read; cheap to copy.
class Source {
 public:
  /// Makes a source of a message of the contract; usually, functions of `sketchmatch::sources` do.
  explicit Source(const v1::Source& message, std::vector<std::string> notes = {});

  /// The message of the contract; include `<sketchmatch/raw.hpp>` to read it.
  [[nodiscard]] const v1::Source& message() const noexcept { return *message_; }

  /// Sentences about what was decided while reading, such as which picture a map was read from.
  [[nodiscard]] const std::vector<std::string>& notes() const noexcept { return notes_; }

 private:
  std::shared_ptr<const v1::Source> message_;
  std::vector<std::string> notes_;
};

/// Which way y grows: it is `down` for screens, tablets and pictures. With the wrong axis, a sketch
/// becomes its mirror image and cannot match.
enum class YAxis { up, down };

/// Where the pen was, and optionally when.
struct StrokePoint {
  double x = 0.0;                 ///< To the right, in units of any size.
  double y = 0.0;                 ///< Up or down by the `YAxis`.
  std::optional<double> seconds;  ///< Time since a moment that is the same for the whole sketch.

  StrokePoint() = default;
  /// A point of the pen.
  StrokePoint(double right, double upwards, std::optional<double> time = std::nullopt)
      : x(right), y(upwards), seconds(time) {}
};

/// Where a grid lies: position and direction of its lower left corner.
struct Pose {
  double x = 0.0;    ///< Metres along the x axis of the map's frame.
  double y = 0.0;    ///< Metres along its y axis.
  double yaw = 0.0;  ///< Radians counter-clockwise from the x axis.
};

namespace sources {

/// Returns a sketch of pen strokes.
/// @param strokes For each stroke its points.
/// @param labels A name for each stroke, or an empty list.
/// @param y_axis `down` for points from a screen or tablet.
/// @throws InvalidRequestError If there is another number of labels, or they are not UTF-8.
Source strokes(const std::vector<std::vector<StrokePoint>>& strokes,
               const std::vector<std::string>& labels = {}, YAxis y_axis = YAxis::up);

/// Returns a sketch or map of polygons without holes.
/// @param outlines For each object the corners of its outline.
/// @param labels A name for each polygon, or an empty list.
/// @param y_axis Which way y grows.
/// @param certainties The certainty, above 0 and up to 1, that each polygon is one thing, or
///   nothing where it is certain; or an empty list.
/// @throws InvalidRequestError As `strokes`.
Source polygons(const std::vector<Ring>& outlines, const std::vector<std::string>& labels = {},
                YAxis y_axis = YAxis::up,
                const std::vector<std::optional<double>>& certainties = {});

/// Returns a sketch or map of polygons, each an outline and its holes, if any.
/// @throws InvalidRequestError As `strokes`.
Source polygons_with_holes(const std::vector<std::vector<Ring>>& polygons,
                           const std::vector<std::string>& labels = {}, YAxis y_axis = YAxis::up,
                           const std::vector<std::optional<double>>& certainties = {});

/// Returns a scene that is stored on the server, by the name that `Client::put_scene` returned.
/// @throws InvalidRequestError If the name is not UTF-8.
Source stored_scene(const std::string& name);

/// Returns a robot's occupancy grid as a map.
/// @param cells −1 unknown, 0 free … 100 occupied, row by row from the lowest: `data` of a ROS
///   `nav_msgs/OccupancyGrid`.
/// @param columns Cells in a row: `info.width`.
/// @param resolution Metres per cell: `info.resolution`.
/// @param origin Pose of the lower left corner of the grid.
/// @throws InvalidRequestError If the cells do not form whole rows of so many columns.
Source occupancy_grid(const std::vector<std::int8_t>& cells, std::uint32_t columns,
                      double resolution, const Pose& origin = {});

/// Returns a map as ROS map_server saved it.
/// @param path The .yaml file; or the picture, if a .yaml beside it names it; or a folder with one
///   map. If the picture is not where the .yaml says, one of that name beside the .yaml is used. If
///   there is a file NAME.objects.geojson beside NAME.yaml, as `sketchmatch segment --out` saves
///   it, the objects are taken from it; the server ignores one that was made for an earlier state
///   of the map. `Source::notes` reports both.
/// @throws InvalidRequestError If the file or its picture cannot be read, or it names no picture.
Source map_server_map(const std::filesystem::path& path);

/// Returns a picture of a map or of a sketch: a PNG, JPEG, WebP, GIF, BMP,
/// TIFF or PGM file.
/// @throws InvalidRequestError If the file cannot be read.
Source image(const std::filesystem::path& path);

/// Returns a picture from the bytes of its file.
Source image_of(const std::string& bytes);

/// Returns a file that the server reads: a drawing in SVG, strokes in JSON, polygons in GeoJSON, a
/// picture, a ROS bag, or a file of another tool that is listed under `readers` by
/// `Client::algorithms`.
/// @param path The file.
/// @param part Which part of it to read, such as layers of a drawing or the topic of a bag.
/// @param name A name to use instead of the file's own; its ending tells the kind of file.
/// @throws InvalidRequestError If the file cannot be read.
Source file(const std::filesystem::path& path, const std::string& part = {},
            const std::string& name = {});

/// Returns a file from its bytes.
/// @param bytes The content of the file.
/// @param name Its name; the ending tells the kind of file.
/// @param part Which part of it to read.
/// @throws InvalidRequestError If the name is empty.
Source file_of(const std::string& bytes, const std::string& name, const std::string& part = {});

}  // namespace sources
}  // namespace sketchmatch
