// clearance-judge: certificates before the judge, as tools/check_certificate.py has them before itself.
#include <fstream>
#include <iostream>
#include <iterator>

#include "certificate_judge.h"

namespace clearance::judge {
namespace {

bool judge_stream(const std::string& name, std::istream& stream) {
  const std::string text{std::istreambuf_iterator<char>(stream), {}};
  const Findings findings = stream.bad() || stream.fail() ? Findings{"it cannot be read", {}} : judge_certificate(text);
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
}  // namespace clearance::judge

// Exit code 0: every row of every file is proved. 1: some are not, or a file is no certificate.
int main(int argc, char** argv) {
  if (argc < 2 || std::string_view(argv[1]).starts_with("--")) {
    std::cout << "clearance-judge FILE...: are all rows of these certificates proved?\n";
    return argc < 2 ? 1 : 0;
  }
  bool good = true;
  for (int k = 1; k < argc; ++k) {
    std::ifstream file(argv[k], std::ios::binary);
    good = clearance::judge::judge_stream(argv[k], file) && good;
  }
  return good ? 0 : 1;
}
