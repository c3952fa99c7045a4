/// @file
/// Options of matches, of calls and of clients.
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

/// An object of a scene: its index, from 0, or its label, if no other object has the same.
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

/// What is known about a sketched object.
struct Pin {
  ObjectReference sketch;              ///< The sketched object.
  std::optional<ObjectReference> map;  ///< Its mapped object, or nothing: it is not on the map.
  bool excluded = false;               ///< Whether it is *not* this one: any other may be, or none.
};

/// The weights of the parts of ζ.
struct Weights {
  double similarity = 1.0;         ///< How alike the relations are.
  double rotation = 1.0;           ///< How well their rotations agree.
  double dilation = 1.0;           ///< How well their dilations agree.
  std::optional<double> shape;     ///< How alike in shape the objects are.
  std::optional<double> size;      ///< How well their sizes agree.
  std::optional<double> distance;  ///< β: a rotation of objects d apart has weight d^β.
};

/// The order of a caller's own requests while they wait.
enum class Priority { unspecified, low, normal, high };

/// How to match. For what is left out, the server has defaults.
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
  /// Time after which the search stops, with the best match so far as the result.
  std::optional<Seconds> time_budget;
  /// The weights of the parts of ζ.
  std::optional<Weights> weights;
  /// Whether objects of both sides may stay without partner where that is more likely.
  std::optional<bool> allow_unmatched;
  /// Price of leaving out all objects of the smaller scene, in units of ζ.
  std::optional<double> unmatched_price;
  /// Number of next best object maps in the result, at most 100.
  std::optional<std::uint32_t> alternatives;
  /// What is known about single objects; the answer obeys it.
  std::vector<Pin> pins;
  /// Labels that mean the same: `{{"couch", "sofa"}}`. Labels are evidence; they do not force a
  /// match.
  std::vector<std::vector<std::string>> synonyms;
  /// Name of a profile of the server, such as "proof", to start from.
  std::string profile;
  /// A name for the request, at most 128 bytes. A request that is sent again under the same name
  /// is done only once. If left out, the client makes a name for each match.
  std::string request_id;
  /// Whether the match continues when no client reads it; `Client::watch` reads it again.
  bool keep_running = false;
  /// The order among this caller's requests while they wait; by default `normal`.
  Priority priority = Priority::unspecified;
};

/// How to find the objects of one source. For what is left out, the server has defaults.
struct SegmentOptions {
  std::string segmenter;     ///< Name of the algorithm.
  Parameters params;         ///< Its parameters.
  std::string profile;       ///< Profile of the server for what is left out.
  bool include_map = false;  ///< Whether to return the occupancy grid, too, such as that of a bag.
};

/// How to make a call.
struct CallOptions {
  /// Time after which the call fails, or infinity for no limit; by default that of the client.
  std::optional<Seconds> timeout;
  /// Stops the call from elsewhere.
  Cancellation cancellation;
};

/// A file in PEM, or its content.
class Pem {
 public:
  /// A file.
  Pem(std::filesystem::path file)  // NOLINT(google-explicit-constructor)
      : value_(std::move(file)), is_file_(true) {}
  /// A file.
  Pem(const std::string& file) : Pem(std::filesystem::path(file)) {}  // NOLINT
  /// A file.
  Pem(const char* file) : Pem(std::filesystem::path(file)) {}  // NOLINT
  /// The content of a file.
  static Pem content(const std::string& text) {
    Pem pem{std::filesystem::path(text)};
    pem.is_file_ = false;
    return pem;
  }

  /// The path of the file, or its content.
  [[nodiscard]] const std::string& value() const noexcept { return value_.native(); }
  /// Whether it is a file.
  [[nodiscard]] bool is_file() const noexcept { return is_file_; }

 private:
  std::filesystem::path value_;
  bool is_file_;
};

/// How a client connects and identifies itself. Options from `token` on that are left out are taken
/// from the environment, such as `token` from `SKETCHMATCH_TOKEN`. An empty text means none.
struct ClientOptions {
  /// Time limit of calls that have none of their own; by default there is no limit.
  std::optional<Seconds> timeout;
  /// How often a request is sent again if the server is not available or busy, after a pause that
  /// the server asks for or that grows from 0.1 s. The timeout is for all attempts together. If the
  /// connection of a running match is lost, the client tries for a minute to continue it, whatever
  /// this number is, unless it is 0.
  int retries = 3;
  /// The token that is sent with every call and identifies the caller.
  std::optional<std::string> token;
  /// A file with the token, instead of the token itself.
  std::optional<std::filesystem::path> token_file;
  /// Whether to encrypt; by default this is done if certificates are given. True alone trusts the
  /// authorities that gRPC trusts.
  std::optional<bool> tls;
  /// Certificates of the authorities to trust instead.
  std::optional<Pem> root_certificates;
  /// The client's certificate, which identifies the caller.
  std::optional<Pem> certificate;
  /// The private key of the certificate.
  std::optional<Pem> key;
  /// The name in the server's certificate, if it is not the one in the address.
  std::optional<std::string> server_name;
  /// Credentials of gRPC, instead of the options for encryption above.
  std::shared_ptr<grpc::ChannelCredentials> credentials;
};

}  // namespace sketchmatch
