#include "server/app/config_file.h"

#include <algorithm>
#include <cctype>
#include <sstream>
#include <stdexcept>

namespace clearance {

namespace {

std::string trimmed(const std::string& text) {
  const std::size_t begin = text.find_first_not_of(" \t\r"), end = text.find_last_not_of(" \t\r");
  return begin == std::string::npos ? "" : text.substr(begin, end - begin + 1);
}

bool is_quote(char c) {
  return c == '"' || c == '\'';
}

std::string without_quotes(const std::string& name) {
  return name.size() > 1 && is_quote(name[0]) && name.back() == name[0] ? name.substr(1, name.size() - 2) : name;
}

bool is_flag_value(const std::string& value) {
  const std::string word = CLI::detail::to_lower(without_quotes(value));
  for (const char* known : {"true", "false", "on", "off", "yes", "no", "enable", "disable", "1", "0"})
    if (word == known) return true;
  return false;
}

}  // namespace

std::vector<CLI::ConfigItem> ConfigFile::from_config(std::istream& input) const {
  file_ = app_.get_config_ptr()->as<std::string>();
  entries_ = entries_of(input);
  check(entries_);
  std::stringstream one_a_line;  // CLI11 rejects a list that begins with "[" alone on its line
  for (const Entry& entry : entries_)
    if (!entry.is_limit) one_a_line << entry.name << " = " << entry.value << "\n";
  return CLI::ConfigTOML::from_config(one_a_line);
}

void ConfigFile::for_each_limit(const std::function<void(const std::string&, const std::string&)>& set) const {
  for (const Entry& entry : entries_) {
    if (!entry.is_limit) continue;
    try {
      set(entry.name, without_quotes(entry.value));
    } catch (const std::invalid_argument& error) {
      fail(entry.line, error.what());
    }
  }
}

std::string ConfigFile::place_of(const std::string& error, std::span<const char* const> command_line) const {
  for (const Entry& entry : entries_) {
    if (entry.is_limit) continue;
    const std::string name = "--" + entry.name;
    const auto is_it = [&](std::string_view word) { return word.substr(0, word.find('=')) == name; };
    if (std::any_of(command_line.begin(), command_line.end(), is_it)) continue;
    const std::size_t at = error.find(name);
    const std::string_view after = at == std::string::npos ? "" : std::string_view(error).substr(at + name.size());
    if (at != std::string::npos && (after.empty() || (!std::isalnum(after[0]) && after[0] != '-')))
      return file_ + ":" + std::to_string(entry.line) + ": ";
  }
  return "";
}

void ConfigFile::fail(int line, const std::string& what) const {
  throw CLI::ConfigError(file_ + ":" + std::to_string(line) + ": " + what);
}

std::vector<ConfigFile::Entry> ConfigFile::entries_of(std::istream& text) const {
  std::vector<Entry> entries;
  int at = 0;
  bool is_limit = false;
  for (std::string line; std::getline(text, line);) {
    ++at;
    if (at == 1 && line.starts_with("\xEF\xBB\xBF")) line.erase(0, 3);
    line = trimmed(line);
    if (line.empty() || line[0] == '#' || line[0] == ';') continue;
    if (line.front() == '[' && line.back() == ']') {
      is_limit = line == "[limits]";
      if (is_limit || CLI::detail::to_lower(line) == "[default]") continue;
      fail(at, "a section, " + line.substr(0, 60) + "; options stand outside of sections, limits in [limits]");
    }
    entries.push_back(read_entry(line, &at, text));
    entries.back().is_limit = is_limit;
  }
  return entries;
}

// Reads an entry. A list may span lines; `line` is then the last of them.
ConfigFile::Entry ConfigFile::read_entry(const std::string& text, int* line, std::istream& more) const {
  const std::size_t equals = text.find('=');
  Entry entry{without_quotes(trimmed(text.substr(0, std::min(equals, text.find('#'))))), "true", *line};
  if (equals == std::string::npos || equals > text.find('#')) return entry;
  std::string value = trimmed(text.substr(equals + 1));
  value = trimmed(value.substr(0, value.find('#')));  // in quotes, too, as in CLI11
  if (value.empty()) fail(*line, entry.name + ": expected a value");
  if (value[0] == '[') {
    std::string next;
    while (value.back() != ']' && std::getline(more, next)) {
      ++*line;
      value += trimmed(next.substr(0, next.find('#')));
    }
    if (value.back() != ']') fail(entry.line, entry.name + ": the list has no end; expected ]");
  } else if (is_quote(value[0]) && (value.size() == 1 || value.back() != value[0])) {
    fail(*line, entry.name + ": the text has no end; expected " + value[0] +
                    (text.find('#') == std::string::npos ? "" : " before #, which begins a comment"));
  }
  entry.value = value;
  return entry;
}

const CLI::Option* ConfigFile::option_of(const std::string& name) const {
  if (const CLI::Option* option = app_.get_option_no_throw("--" + name)) return option;
  return name.size() == 1 ? app_.get_option_no_throw("-" + name) : nullptr;
}

void ConfigFile::check(const std::vector<Entry>& entries) const {
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const auto& [name, value, line, is_limit] = entries[i];
    if (is_limit) {
      for (std::size_t before = 0; before < i; ++before)
        if (entries[before].is_limit && entries[before].name == name)
          fail(line, name + " is already set in line " + std::to_string(entries[before].line));
      continue;
    }
    const CLI::Option* option = option_of(name);
    if (!option) fail(line, "there is no option \"" + name.substr(0, 60) + "\"");
    if (!option->get_configurable()) fail(line, name + " is for the command line alone");
    if (option->get_expected_min() == 0 && !is_flag_value(value))
      fail(line, name + ": expected true or false, got " + value.substr(0, 60));
    for (std::size_t before = 0; before < i; ++before)
      if (!entries[before].is_limit && option_of(entries[before].name) == option &&
          (option->get_items_expected_max() < 2 || before + 1 < i))
        fail(line, name + " is already set in line " + std::to_string(entries[before].line));
  }
}

}  // namespace clearance
