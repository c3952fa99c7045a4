#include <sketchmatch/v1/catalog_service.pb.h>
#include <sketchmatch/v1/match.pb.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <sketchmatch/summary.hpp>
#include <sstream>
#include <vector>

#include "text.hpp"

namespace sketchmatch {

namespace {

using Row = std::vector<std::string>;

constexpr std::size_t kRows = 20;
constexpr std::size_t kLongest = 60;
constexpr std::size_t kLongestLabel = 30;

std::string fixed(double number, int digits) {
  std::ostringstream out;
  out.setf(std::ios::fixed);
  out.precision(digits);
  out << number;
  return out.str();
}

/// Returns a number with four significant digits.
std::string rounded(double number) {
  std::ostringstream out;
  out.precision(4);
  out << number;
  return out.str();
}

/// Returns a probability that rounds to 1 only if it is.
std::string likelihood(double probability) {
  constexpr double kRoundsToOne = 0.9995;
  return probability >= kRoundsToOne && probability < 1.0 ? ">0.999" : fixed(probability, 3);
}

std::string counted(std::uint64_t count, const std::string& what) {
  return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}

bool continues(char byte) { return (static_cast<unsigned char>(byte) & 0xC0U) == 0x80; }

/// How many characters a text has.
std::size_t width_of(const std::string& text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char byte) { return !continues(byte); }));
}

/// Returns what fits into a cell: one line, without control sequences for terminals.
std::string cut(const std::string& text, std::size_t longest) {
  std::string line;
  for (const char each : detail::stripped(text)) {
    const auto byte = static_cast<unsigned char>(each);
    line += byte < 0x20 || byte == 0x7F ? ' ' : each;
  }
  if (width_of(line) <= longest) {
    return line;
  }
  std::size_t end = 0;
  for (std::size_t count = 0; end < line.size(); ++end) {
    count += continues(line.at(end)) ? 0 : 1;
    if (count > longest - 3) {
      break;
    }
  }
  return line.substr(0, end) + "...";
}

std::string named(std::uint32_t index, const std::string& label) {
  const std::string name = cut(label, kLongestLabel);
  return std::to_string(index) + (name.empty() ? "" : " " + name);
}

std::string named(std::uint32_t index, const Scene& scene) {
  return named(index, index < scene.objects.size() ? scene.objects.at(index).label : std::string());
}

/// Returns a table whose first columns are names, which are aligned left.
std::string table(const std::string& title, const std::vector<Row>& rows, std::size_t names,
                  std::size_t most = kRows) {
  const std::size_t shown = std::min(rows.size(), most + 1);  // one has the heads
  std::vector<std::size_t> widths(rows.front().size(), 0);
  for (std::size_t n = 0; n < shown; ++n) {
    for (std::size_t k = 0; k < widths.size(); ++k) {
      widths[k] = std::max(widths[k], width_of(rows[n][k]));
    }
  }
  std::string text = title;
  for (std::size_t n = 0; n < shown; ++n) {
    std::string line;
    for (std::size_t k = 0; k < widths.size(); ++k) {
      const std::string gap(widths[k] - width_of(rows[n][k]), ' ');
      line += (k == 0 ? "" : "  ") + (k < names ? rows[n][k] + gap : gap + rows[n][k]);
    }
    text += "\n" + line.substr(0, line.find_last_not_of(' ') + 1);
  }
  if (rows.size() > shown) {
    text += "\n... and " + std::to_string(rows.size() - shown) + " more";
  }
  return text;
}

/// Whether a sketched object belongs to a group.
bool grouped(const MatchResult& result, std::uint32_t object) {
  return std::any_of(result.object_groups.begin(), result.object_groups.end(),
                     [object](const ObjectGroup& group) {
                       const auto& members = group.sketch_objects;
                       return std::find(members.begin(), members.end(), object) != members.end();
                     });
}

/// Returns the names of several objects.
std::string named(const std::vector<std::uint32_t>& objects, const Scene& scene) {
  std::string names;
  for (const auto object : objects) {
    names += (names.empty() ? "" : " + ") + named(object, scene);
  }
  return names;
}

/// Returns a line that summarises a match.
std::string headline(const Match& match) {
  const auto& result = match.result;
  const auto& alone = result.unmatched_sketch_objects;
  const auto drawn = result.object_matches.size() + alone.size();
  const auto left = static_cast<std::size_t>(std::count_if(
      alone.begin(), alone.end(), [&result](auto object) { return !grouped(result, object); }));
  std::string line = std::to_string(drawn - left) + " of " + std::to_string(drawn) +
                     " sketched objects matched, FMAP confidence " +
                     fixed(result.fmap_confidence.total, 3) + ", OMAP confidence " +
                     fixed(result.omap_confidence, 3);
  if (result.probability) {
    line += ", probability " + likelihood(*result.probability);
  }
  if (result.place_probability) {
    const std::string likely = likelihood(*result.place_probability);
    if (*result.place_probability < 0.5) {
      line.insert(0, "probably not this place (this place: " + likely + "): ");
    } else {
      line += ", this place " + likely;
    }
  }
  if (result.ambiguity && !result.ambiguity->deciding_sketch_objects.empty()) {
    line += ", " + std::to_string(result.ambiguity->maps) + " maps about as likely, ask what " +
            named(result.ambiguity->deciding_sketch_objects.front(), match.scenes.sketch) + " is";
  }
  return line + ", " + name_of(result.outcome);
}

/// Returns the name of an enum's value without the prefix that all have.
template <typename Kind>
std::string enum_name(Kind kind, const std::string& name, const char* prefix) {
  return name.empty() ? std::to_string(static_cast<int>(kind))
                      : name.substr(std::char_traits<char>::length(prefix));
}

}  // namespace

std::string name_of(Outcome outcome) {
  return enum_name(outcome, v1::Outcome_Name(static_cast<v1::Outcome>(outcome)), "OUTCOME_");
}

std::string name_of(Phase phase) {
  return enum_name(phase, v1::Phase_Name(static_cast<v1::Phase>(phase)), "PHASE_");
}

std::string name_of(AlgorithmKind kind) {
  return enum_name(kind, v1::AlgorithmKind_Name(static_cast<v1::AlgorithmKind>(kind)),
                   "ALGORITHM_KIND_");
}

std::string summary(const Match& match) {
  std::vector<Row> rows{{"in the sketch", "on the map", "confidence", "probability", "margin"}};
  for (const auto& line : match.result.object_matches) {
    rows.push_back({named(line.sketch_object, line.sketch_label),
                    named(line.map_object, line.map_label), fixed(line.confidence, 3),
                    line.probability ? likelihood(*line.probability) : "",
                    line.margin ? fixed(*line.margin, 3) : ""});
  }
  const auto& unmatched = match.result.unmatched_sketch_objects;
  const auto& likely = match.result.unmatched_sketch_probabilities;
  for (std::size_t k = 0; k < unmatched.size(); ++k) {
    if (!grouped(match.result, unmatched[k])) {
      rows.push_back({named(unmatched[k], match.scenes.sketch), "no partner", "",
                      k < likely.size() ? likelihood(likely[k]) : "", ""});
    }
  }
  for (const auto& group : match.result.object_groups) {
    rows.push_back({named(group.sketch_objects, match.scenes.sketch),
                    named(group.map_objects, match.scenes.map), "as one",
                    group.probability ? likelihood(*group.probability) : "", ""});
  }
  return table(headline(match), rows, 2);
}

std::string summary(const Progress& progress) {
  std::string line = name_of(progress.phase) + ", " + fixed(progress.elapsed.count(), 2) + " s";
  if (progress.fraction) {
    line += ", " + fixed(100.0 * *progress.fraction, 0) + "%";
  }
  if (progress.confidence) {
    line += ", confidence " + fixed(*progress.confidence, 3) + ", " +
            counted(progress.evaluations, "evaluation");
  }
  if (progress.upper_bound) {
    line += ", at most " + fixed(*progress.upper_bound, 3);
  }
  return line;
}

std::string summary(const Segmentation& found) {
  std::vector<Row> rows{{"object", "area", "x", "y"}};
  const auto& objects = found.scene.objects;
  for (std::size_t k = 0; k < objects.size(); ++k) {
    rows.push_back({named(static_cast<std::uint32_t>(k), objects[k].label),
                    rounded(objects[k].area), rounded(objects[k].centroid.x),
                    rounded(objects[k].centroid.y)});
  }
  std::string text =
      table(counted(objects.size(), "object") + ", by " + found.segmenter.name, rows, 1);
  for (const auto& warning : found.warnings) {
    text += "\n" + warning;
  }
  return text;
}

std::string summary(const Catalogue& catalogue) {
  std::vector<Row> rows{{"kind", "name", "what it does"}};
  for (const auto& each : catalogue.algorithms) {
    rows.push_back({detail::lowered(name_of(each.kind)), each.name + (each.is_default ? " *" : ""),
                    cut(each.summary, kLongest)});
  }
  return table(std::to_string(catalogue.algorithms.size()) + " algorithms; * are the defaults",
               rows, 3, rows.size());
}

std::ostream& operator<<(std::ostream& out, const Match& match) { return out << summary(match); }

std::ostream& operator<<(std::ostream& out, const Progress& progress) {
  return out << summary(progress);
}

std::ostream& operator<<(std::ostream& out, const Segmentation& found) {
  return out << summary(found);
}

std::ostream& operator<<(std::ostream& out, const Catalogue& catalogue) {
  return out << summary(catalogue);
}

}  // namespace sketchmatch
