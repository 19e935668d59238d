// The configuration file of clearanced.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <istream>
#include <span>
#include <string>
#include <vector>

namespace clearance {

/// Reads a file as CLI11 does, after checks whose errors name file and line.
class ConfigFile : public CLI::ConfigTOML {
 public:
  /// @param app with the options that the file may have, by their long names
  explicit ConfigFile(const CLI::App& app) : app_(app) {}

  /// Throws CLI::ConfigError for an unknown or repeated option, an unknown section, and a value that is missing or
  /// without end.
  std::vector<CLI::ConfigItem> from_config(std::istream& input) const override;

  /// Calls set(name, value) for each line of section [limits], and rethrows its std::invalid_argument as
  /// CLI::ConfigError with file and line.
  void for_each_limit(const std::function<void(const std::string&, const std::string&)>& set) const;

  /// Place in the file of the option that an error names, such as "clearanced.toml:4: ". Empty if the file does not
  /// have the option, or if the command line overrides it.
  std::string place_of(const std::string& error, std::span<const char* const> command_line) const;

 private:
  struct Entry {
    std::string name, value;
    int line = 0;
    bool is_limit = false;
  };
  [[noreturn]] void fail(int line, const std::string& what) const;
  std::vector<Entry> entries_of(std::istream& text) const;
  Entry read_entry(const std::string& text, int* line, std::istream& more) const;
  void check(const std::vector<Entry>& entries) const;
  const CLI::Option* option_of(const std::string& name) const;

  const CLI::App& app_;
  mutable std::string file_;
  mutable std::vector<Entry> entries_;
};

}  // namespace clearance
