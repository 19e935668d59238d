// Our programs as separate processes: clearanced until it is stopped, and any program until it ends.
#pragma once

#include <string>
#include <vector>

namespace clearance {

/// A temporary folder, removed with its contents.
class TestFolder {
 public:
  TestFolder();
  ~TestFolder();
  TestFolder(const TestFolder&) = delete;
  TestFolder& operator=(const TestFolder&) = delete;
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }
  const std::string& path() const { return path_; }
  /// Writes a file there and returns its path.
  std::string write(const std::string& name, const std::string& contents) const;

 private:
  std::string path_;
};

/// A scene file without meshes: table (static box), cup, link1, link2 (no pose), group arm.
extern const char* const kSmallSceneYaml;

/// Path of a program of this build: next to this one if it exists there, since tests may be copied to another machine.
std::string program(const std::string& name);

struct Finished {
  int code = -1;  ///< exit code, or minus the signal that ended it
  std::string out, err;
};
/// Runs a program to its end.
/// \param environment "NAME=value", added to this process's
Finished run(const std::vector<std::string>& command, const std::vector<std::string>& environment = {});

/// A clearanced for one test.
class Daemon {
 public:
  /// Starts it and waits until it is ready. Throws std::runtime_error with its log if it ends before.
  /// \param environment "NAME=value", added to this process's
  explicit Daemon(std::vector<std::string> options, const std::vector<std::string>& environment = {});
  /// Stops it if it still runs.
  ~Daemon();
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;

  const std::vector<std::string>& urls() const { return urls_; }
  const std::string& url() const { return urls_.at(0); }
  int pid() const { return pid_; }
  /// Sends a signal and returns the exit code (or minus the signal that ended it).
  int stop(int signal);
  /// Its standard error so far.
  std::string log() const;

 private:
  TestFolder folder_;
  int pid_ = -1;
  std::vector<std::string> urls_;
};

}  // namespace clearance
