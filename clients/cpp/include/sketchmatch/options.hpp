/// @file
/// How to match, how to call and how to get in.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <sketchmatch/cancellation.hpp>
#include <sketchmatch/errors.hpp>
#include <sketchmatch/value.hpp>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

namespace grpc {
class ChannelCredentials;
}

namespace sketchmatch {

/// An object of a scene: its index, from 0, or its label, which no other one has.
class ObjectReference {
 public:
  /// An object by its index.
  template <typename Index, std::enable_if_t<std::is_integral_v<Index>, int> = 0>
  ObjectReference(Index index)  // NOLINT(google-explicit-constructor)
      : kind_(static_cast<std::int64_t>(index)) {}
  /// An object by its label.
  ObjectReference(std::string label)  // NOLINT(google-explicit-constructor)
      : kind_(std::move(label)) {}
  /// An object by its label.
  ObjectReference(const char* label)  // NOLINT(google-explicit-constructor)
      : kind_(std::string(label)) {}

  /// The index or the label.
  [[nodiscard]] const std::variant<std::int64_t, std::string>& kind() const noexcept {
    return kind_;
  }

 private:
  std::variant<std::int64_t, std::string> kind_;
};

/// What is known of a sketched object.
struct Pin {
  ObjectReference sketch;              ///< The sketched object.
  std::optional<ObjectReference> map;  ///< The mapped one that it is; none: it is on no map.
  bool excluded = false;               ///< Whether it is *not* this one: any other may be, or none.
};

/// What the parts of ζ count for.
struct Weights {
  double similarity = 1.0;         ///< How alike the relations are.
  double rotation = 1.0;           ///< How well their rotations agree.
  double dilation = 1.0;           ///< How well their dilations agree.
  std::optional<double> shape;     ///< How alike in shape the objects are.
  std::optional<double> size;      ///< How well their sizes agree.
  std::optional<double> distance;  ///< β: rotations of objects d apart count for d^β.
};

/// Which of a caller's own requests come first while they wait.
enum class Priority { unspecified, low, normal, high };

/// How to match; whatever is left out is the server's to decide.
struct MatchOptions {
  std::string sketch_segmenter;  ///< Name of an algorithm; `Client::algorithms` lists them.
  std::string map_segmenter;     ///< Name of an algorithm.
  std::string histogram;         ///< Name of an algorithm.
  std::string similarity;        ///< Name of an algorithm.
  std::string searcher;          ///< Name of an algorithm.
  std::string judge;             ///< Name of an algorithm.
  /// Parameters by stage, as in `params["searcher"]["population"] = 200`. The stages are the names
  /// of the six options above.
  std::map<std::string, Parameters> params;
  /// Seed of everything random; the same request with the same seed has the same result.
  std::optional<std::uint64_t> seed;
  /// After which time the best match so far is the result.
  std::optional<Seconds> time_budget;
  /// What the parts of ζ count for.
  std::optional<Weights> weights;
  /// Whether an object may stay without partner on both sides where that is likelier.
  std::optional<bool> allow_unmatched;
  /// What a match loses that leaves all objects of the smaller scene out, in units of ζ.
  std::optional<double> unmatched_price;
  /// How many of the next best object maps the result shall hold, at most 100.
  std::optional<std::uint32_t> alternatives;
  /// What is known of single objects, which the answer obeys.
  std::vector<Pin> pins;
  /// Labels that mean the same: `{{"couch", "sofa"}}`. Labels are evidence, and force nothing.
  std::vector<std::vector<std::string>> synonyms;
  /// Name of one of the server's pipelines, such as "proof", to start from.
  std::string profile;
  /// A name for the request, at most 128 bytes: sent again under the same name it is the same
  /// match, done once. Left out: the client makes one for each match.
  std::string request_id;
  /// Whether the match goes on when nobody reads it; `Client::watch` reads it again.
  bool keep_running = false;
  /// Which of one's own requests come first while they wait. Left out: as `normal`.
  Priority priority = Priority::unspecified;
};

/// How to find the objects of one source; whatever is left out is the server's to decide.
struct SegmentOptions {
  std::string segmenter;     ///< Name of the algorithm.
  Parameters params;         ///< Its parameters.
  std::string profile;       ///< The server's pipeline that decides what is left out.
  bool include_map = false;  ///< Whether the occupancy grid is wanted, too, such as that of a bag.
};

/// How to make a call.
struct CallOptions {
  /// After which time the call fails; infinity for no limit. Left out: as the client says.
  std::optional<Seconds> timeout;
  /// What stops the call from elsewhere.
  Cancellation cancellation;
};

/// A file in PEM, or what is in it.
class Pem {
 public:
  /// A file.
  Pem(std::filesystem::path file)  // NOLINT(google-explicit-constructor)
      : value_(std::move(file)), is_file_(true) {}
  /// A file.
  Pem(const std::string& file) : Pem(std::filesystem::path(file)) {}  // NOLINT
  /// A file.
  Pem(const char* file) : Pem(std::filesystem::path(file)) {}  // NOLINT
  /// What is in a file.
  static Pem content(const std::string& text) {
    Pem pem{std::filesystem::path(text)};
    pem.is_file_ = false;
    return pem;
  }

  /// The path of the file, or what is in it.
  [[nodiscard]] const std::string& value() const noexcept { return value_.native(); }
  /// Whether it is a file.
  [[nodiscard]] bool is_file() const noexcept { return is_file_; }

 private:
  std::filesystem::path value_;
  bool is_file_;
};

/// How a client works and gets in. What is left out from `token` on, the environment may say:
/// `SKETCHMATCH_TOKEN` is `token`, and so on. An empty text says that there is none.
struct ClientOptions {
  /// How long a call may take where the call itself does not say. Left out: no limit.
  std::optional<Seconds> timeout;
  /// How often a request is sent again where the server is not available or has no room, after a
  /// pause that the server asks for or that grows from 0.1 s. The timeout is for all attempts
  /// together. A match that has begun goes on by itself where its link is lost, for a minute
  /// whatever their number, unless it is 0.
  int retries = 3;
  /// Shown with every call: it says who calls.
  std::optional<std::string> token;
  /// A file that holds the token, instead.
  std::optional<std::filesystem::path> token_file;
  /// Whether to encrypt; left out, certificates decide. True alone trusts the authorities that gRPC
  /// trusts.
  std::optional<bool> tls;
  /// The authorities to trust instead of these.
  std::optional<Pem> root_certificates;
  /// To be shown to the server: it says who calls.
  std::optional<Pem> certificate;
  /// The private key of the certificate.
  std::optional<Pem> key;
  /// The name that the server's certificate is for, where it is not the one in the address.
  std::optional<std::string> server_name;
  /// Credentials of gRPC's own making, in place of what is said of encryption.
  std::shared_ptr<grpc::ChannelCredentials> credentials;
};

}  // namespace sketchmatch
