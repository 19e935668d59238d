// The oracle of certificates: a second implementation of docs/trust/certificate_format.md, without a line of the engine
// or of tools/check_certificate.py.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace clearance::certificate_oracle {

/// Results for the rows of a document.
struct Findings {
  std::string no_certificate;    ///< reason that the document is no certificate, or empty
  std::vector<std::string> why;  ///< for each row, the reason that it is not proved, or empty

  std::size_t proved() const;
  /// Whether it is a certificate with every row proved.
  bool all_proved() const { return no_certificate.empty() && proved() == why.size(); }
};

/// Checks each row of a document. No content of the document causes an exception.
Findings prove_certificate(std::string_view document);

}  // namespace clearance::certificate_oracle
