#include "text.hpp"

#include <array>
#include <cerrno>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <sketchmatch/errors.hpp>
#include <sstream>
#include <system_error>

namespace sketchmatch::detail {

namespace {

constexpr std::size_t kLongest = 60;

/// How many bytes a character has that begins with this byte; 0 if none does.
std::size_t length_of(unsigned char first) {
  if (first < 0x80) {
    return 1;
  }
  if (first >= 0xC2 && first <= 0xDF) {
    return 2;
  }
  if (first >= 0xE0 && first <= 0xEF) {
    return 3;
  }
  return first >= 0xF0 && first <= 0xF4 ? 4 : 0;
}

/// Whether the second byte of a character may follow the first: neither surrogates nor long forms.
bool follows(unsigned char first, unsigned char second) {
  switch (first) {
    case 0xE0:
      return second >= 0xA0 && second <= 0xBF;
    case 0xED:
      return second >= 0x80 && second <= 0x9F;
    case 0xF0:
      return second >= 0x90 && second <= 0xBF;
    case 0xF4:
      return second >= 0x80 && second <= 0x8F;
    default:
      return second >= 0x80 && second <= 0xBF;
  }
}

}  // namespace

void refuse(const std::string& field, const std::string& problem, const std::string& reason) {
  throw InvalidRequestError(field + " " + problem, reason, field);
}

bool is_utf8(std::string_view bytes) {
  for (std::size_t k = 0; k < bytes.size();) {
    const auto first = static_cast<unsigned char>(bytes[k]);
    const std::size_t length = length_of(first);
    if (length == 0 || bytes.size() - k < length) {
      return false;
    }
    for (std::size_t n = 1; n < length; ++n) {
      const auto next = static_cast<unsigned char>(bytes[k + n]);
      if (n == 1 ? !follows(first, next) : next < 0x80 || next > 0xBF) {
        return false;
      }
    }
    k += length;
  }
  return true;
}

const std::string& checked_text(const std::string& text, const std::string& field) {
  if (!is_utf8(text)) {
    refuse(field, "is " + in_quotes(text) + ", which is not UTF-8; convert it");
  }
  return text;
}

std::string in_quotes(std::string_view text) {
  const bool whole = is_utf8(text);
  std::string line = "'";
  for (const char each : text.substr(0, kLongest)) {
    const auto byte = static_cast<unsigned char>(each);
    line += byte < 0x20 || byte == 0x7F || (byte >= 0x80 && !whole) ? '?' : each;
  }
  while (!is_utf8(line)) {  // a character that was cut
    line.pop_back();
  }
  return line + (text.size() > kLongest ? "...'" : "'");
}

std::string shown(double number) {
  std::ostringstream out;
  out << number;
  return out.str();
}

std::string filled(std::string_view pattern, std::string_view value) {
  std::string text(pattern);
  const auto place = text.find("{}");
  return place == std::string::npos ? text : text.replace(place, 2, value);
}

bool starts_with(std::string_view text, std::string_view head) {
  return text.substr(0, head.size()) == head;
}

std::string lowered(std::string text) {
  for (char& each : text) {
    if (each >= 'A' && each <= 'Z') {
      each = static_cast<char>(each - 'A' + 'a');
    }
  }
  return text;
}

std::string stripped(std::string_view text) {
  constexpr std::string_view kSpaces = " \t\r\n\f\v";
  const auto first = text.find_first_not_of(kSpaces);
  if (first == std::string_view::npos) {
    return {};
  }
  return std::string(text.substr(first, text.find_last_not_of(kSpaces) - first + 1));
}

std::string read_bytes(const std::filesystem::path& path) {
  if (std::filesystem::is_directory(path)) {
    throw std::system_error(EISDIR, std::generic_category());
  }
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  if (!file.is_open() || file.bad()) {
    throw std::system_error(errno != 0 ? errno : EIO, std::generic_category());
  }
  return bytes;
}

std::string text_of(const std::filesystem::path& path) { return path.string(); }

}  // namespace sketchmatch::detail
