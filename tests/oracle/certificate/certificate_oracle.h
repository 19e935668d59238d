// The judge of certificates: docs/certificates.md read a second time, without a line of the engine or of
// tools/check_certificate.py.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace clearance::certificate_oracle {

/// What is found of the rows of a document.
struct Findings {
  std::string no_certificate;    ///< why the document is none; empty if it is one
  std::vector<std::string> why;  ///< of each row, why it is not proved; empty if it is

  std::size_t proved() const;
  /// It is a certificate of which every row is proved.
  bool all_proved() const { return no_certificate.empty() && proved() == why.size(); }
};

/// Judges each row of a document. Throws nothing for what the document says.
Findings prove_certificate(std::string_view document);

}  // namespace clearance::certificate_oracle
