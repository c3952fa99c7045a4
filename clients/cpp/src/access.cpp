#include "access.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <system_error>
#include <utility>

#include "address.hpp"
#include "text.hpp"

namespace sketchmatch::detail {

namespace {

/// A value that was given, and where: the name of an option or of a variable.
struct Said {
  std::string place;
  std::string value;
  bool is_file = false;

  [[noreturn]] void refuse(const std::string& problem) const { detail::refuse(place, problem); }

  /// Returns the value itself, or the content of the file that it names.
  [[nodiscard]] std::string content() const {
    if (!is_file) {
      return value;
    }
    try {
      return read_bytes(value);
    } catch (const std::system_error& error) {
      refuse("names " + value + ", which cannot be read (" + lowered(error.code().message()) +
             "); check the path");
    }
  }
};

std::optional<Said> from_environment(const std::string& name, bool is_file) {
  std::string variable = "SKETCHMATCH_" + name;
  std::transform(variable.begin(), variable.end(), variable.begin(), [](char c) {
    return c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
  });
  const char* text = std::getenv(variable.c_str());  // NOLINT(concurrency-mt-unsafe): none sets it
  if (text == nullptr || *text == '\0') {
    return std::nullopt;
  }
  return Said{variable, text, is_file};
}

/// Returns the value of an option, or else of its environment variable.
std::optional<Said> said(const std::string& name, const std::optional<std::string>& given,
                         bool is_file) {
  if (given) {
    return given->empty() ? std::nullopt : std::optional(Said{name, *given, is_file});
  }
  return from_environment(name, is_file);
}

std::optional<Said> said(const std::string& name, const std::optional<Pem>& given) {
  if (given) {
    return said(name, std::optional(given->value()), given->is_file());
  }
  return from_environment(name, true);
}

std::optional<bool> tls_of(const ClientOptions& options) {
  if (options.tls) {
    return options.tls;
  }
  const auto found = from_environment("tls", false);
  if (!found) {
    return std::nullopt;
  }
  const std::string text = lowered(stripped(found->value));
  if (text == "1" || text == "true") {
    return true;
  }
  if (text == "0" || text == "false") {
    return false;
  }
  if (!text.empty()) {
    found->refuse("is " + in_quotes(text) + "; give 1 or 0");
  }
  return std::nullopt;
}

std::string pem_of(const std::optional<Said>& found, const char* mark, const char* what) {
  if (!found) {
    return {};
  }
  std::string data = found->content();
  if (data.find(mark) == std::string::npos) {
    found->refuse(std::string("holds no ") + what +
                  " in PEM; give a file that begins with -----BEGIN");
  }
  return data;
}

void refuse_all(const ClientOptions& options, const char* problem, bool with_tls) {
  const std::array given{std::pair("tls", with_tls && options.tls.has_value()),
                         std::pair("root_certificates", options.root_certificates.has_value()),
                         std::pair("certificate", options.certificate.has_value()),
                         std::pair("key", options.key.has_value())};
  for (const auto& [name, is_given] : given) {
    if (is_given) {
      refuse(name, problem);
    }
  }
}

/// Returns the credentials for encryption, or nothing for none.
std::shared_ptr<grpc::ChannelCredentials> credentials_of(const ClientOptions& options) {
  const auto tls = tls_of(options);
  if (tls == false) {
    refuse_all(options, "needs encryption; leave out tls = false", false);
    return nullptr;
  }
  const auto roots = said("root_certificates", options.root_certificates);
  const auto certificate = said("certificate", options.certificate);
  const auto key = said("key", options.key);
  grpc::SslCredentialsOptions ssl;
  ssl.pem_root_certs = pem_of(roots, " CERTIFICATE-----", "certificate");
  ssl.pem_cert_chain = pem_of(certificate, " CERTIFICATE-----", "certificate");
  ssl.pem_private_key = pem_of(key, "PRIVATE KEY-----", "private key, without a passphrase,");
  if (certificate && !key) {
    certificate->refuse("is given without key; give both");
  }
  if (key && !certificate) {
    key->refuse("is given without certificate; give both");
  }
  if (tls.value_or(false) || roots || certificate) {
    return grpc::SslCredentials(ssl);
  }
  return nullptr;
}

bool is_token(const std::string& token) {
  return !token.empty() &&
         std::all_of(token.begin(), token.end(), [](char c) { return c > ' ' && c < 0x7F; });
}

/// Returns the token and where it was given, if it was.
std::optional<Said> token_of(const ClientOptions& options) {
  if (options.token && options.token_file) {
    refuse("token_file", "cannot be used with token; drop one of the two");
  }
  const auto token_file = options.token_file ? std::optional(text_of(*options.token_file))
                                             : std::optional<std::string>();
  if (options.token) {
    return said("token", options.token, false);
  }
  if (!token_file) {
    if (auto found = from_environment("token", false)) {
      return found;
    }
  }
  return said("token_file", token_file, true);
}

}  // namespace

Access access_to(const std::string& address, const ClientOptions& options) {
  Access access;
  access.credentials = options.credentials;
  if (access.credentials) {
    refuse_all(options, "cannot be used with credentials; drop one of the two", true);
  } else {
    access.credentials = credentials_of(options);
  }
  check_address(address, access.credentials != nullptr);
  if (const auto name = said("server_name", options.server_name, false)) {
    access.server_name = name->value;
  }
  const auto found = token_of(options);
  if (!found) {
    return access;
  }
  const std::string token = stripped(found->content());
  if (!is_token(token)) {
    // The error does not quote it: it may be a secret all the same.
    found->refuse("is not a token; give what `sketchmatch tokens add` printed");
  }
  if (!access.credentials && !is_here(address)) {
    found->refuse("would go to " + address +
                  " without encryption, so others could read it; give the root_certificates of the "
                  "server's authority, or switch on tls");
  }
  access.authorization = "Bearer " + token;
  return access;
}

}  // namespace sketchmatch::detail
