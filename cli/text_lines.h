// UTF-8 text files of users, line by line.
#pragma once

#include <fstream>
#include <iostream>
#include <stdexcept>
#include <string>

namespace clearance::cli {

/// Calls use(line, place) for each line of a file, with its place as in "path.csv:3". A byte order mark is skipped, and
/// so is the carriage return at the end of a line. Throws std::invalid_argument for a file that cannot be read, or is
/// not UTF-8.
/// \param file "-" for standard input
/// \param option put before the file's name in places and errors
template <class Use>
void for_each_line(const std::string& file, const std::string& option, Use use) {
  std::ifstream opened;
  if (file != "-") opened.open(file, std::ios::binary);
  std::istream& in = file == "-" ? std::cin : opened;
  const std::string name = option + (file == "-" ? "standard input" : file);
  if (!in) throw std::invalid_argument(name + ": cannot be read");
  std::size_t number = 0;
  for (std::string line; std::getline(in, line);) {
    const std::string place = name + ":" + std::to_string(++number);
    if (number == 1 && (line.starts_with("\xFF\xFE") || line.starts_with("\xFE\xFF")))
      throw std::invalid_argument(name + ": the text is UTF-16; save it as UTF-8");
    if (number == 1 && line.starts_with("\xEF\xBB\xBF")) line.erase(0, 3);
    if (line.find('\0') != std::string::npos)
      throw std::invalid_argument(place + ": expected UTF-8 text, got a NUL byte; save UTF-16 as UTF-8");
    if (line.ends_with('\r')) line.pop_back();
    use(line, place);
  }
  if (in.bad()) throw std::invalid_argument(name + ": cannot be read");
}

}  // namespace clearance::cli
