// `clearance-check-certificate`: checks certificates with this oracle, in place of tools/check_certificate.py.
#include <fstream>
#include <iostream>
#include <sstream>

#include "tests/oracle/certificate/certificate_oracle.h"

namespace clearance::certificate_oracle {
namespace {

bool check_file(const std::string& name) {
  std::ifstream file(name, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  const Findings findings = file && text ? prove_certificate(text.view()) : Findings{"it cannot be read", {}};
  if (!findings.no_certificate.empty()) {
    std::cout << name << ": no certificate: " << findings.no_certificate << '\n';
    return false;
  }
  for (std::size_t k = 0; k < findings.why.size(); ++k)
    if (!findings.why[k].empty()) std::cout << name << ": rows[" << k << "]: NOT PROVED: " << findings.why[k] << '\n';
  std::cout << name << ": " << findings.proved() << " of " << findings.why.size() << " rows are proved\n";
  return findings.all_proved();
}

}  // namespace
}  // namespace clearance::certificate_oracle

// Exit code 0 if every row of every file is proved, 1 if some are not or a file is no certificate.
int main(int argc, char** argv) {
  if (argc < 2 || std::string_view(argv[1]).starts_with("--")) {
    std::cout << "clearance-check-certificate FILE...: are all rows of these certificates proved?\n";
    return argc < 2 ? 1 : 0;
  }
  bool good = true;
  for (int k = 1; k < argc; ++k) good = clearance::certificate_oracle::check_file(argv[k]) && good;
  return good ? 0 : 1;
}
