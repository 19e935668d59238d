// External text stays one value in one line of the log.
#include <gtest/gtest.h>

#include <random>

#include "server/base/error_log.h"
#include "server/base/log_text.h"

namespace clearance {
namespace {

TEST(LogText, EscapesWhatDoesNotPrint) {
  EXPECT_EQ(log_text("table 7"), "table 7");
  EXPECT_EQ(log_text("a\nb\tc\rd"), "a\\nb\\tc\\x0dd");
  EXPECT_EQ(log_text("\x1b[31mred\x7f"), "\\x1b[31mred\\x7f");
  EXPECT_EQ(log_text(std::string_view("\0x", 2)), "\\x00x");
  EXPECT_EQ(log_text("x\" event=reloaded \\"), "x\\\" event=reloaded \\\\");
  EXPECT_EQ(log_text("the key \"x\"\n", false), "the key \"x\"\\n");
  EXPECT_EQ(log_text("Tisch-Größe 桌子 🤖"), "Tisch-Größe 桌子 🤖");
  EXPECT_EQ(log_text("\xc2\x9b"
                     "31m"),
            "\\xc2\\x9b31m")
      << "CSI in one character";
  EXPECT_EQ(log_text("\xe2\x80\xae"
                     "abc"),
            "\\xe2\\x80\\xae"
            "abc")
      << "right to left from here";
  for (const char* broken : {"\xff", "\xc3", "\xe6\xa1", "\xc0\x8a", "\xed\xa0\x80", "\xf5\x80\x80\x80"})
    EXPECT_EQ(log_text(broken).substr(0, 2), "\\x") << "no UTF-8";
}

TEST(LogText, WhateverComesIsOneLine) {
  std::mt19937 random(3);
  std::uniform_int_distribution<int> byte(0, 255);
  for (int i = 0; i < 2000; ++i) {
    std::string text(20, ' ');
    for (char& c : text) c = static_cast<char>(byte(random));
    bool in_escape = false;
    for (const char c : log_text(text)) {
      ASSERT_TRUE(static_cast<unsigned char>(c) >= ' ' && c != 0x7f);
      ASSERT_TRUE(c != '"' || in_escape);
      in_escape = c == '\\' && !in_escape;
    }
  }
}

TEST(LogText, OfErrorsToo) {
  ErrorLog log;
  log.note("bad_query", "no body 'x\ny\x1b[2J'");
  const std::string text = error_text(log.entries());
  EXPECT_NE(text.find("no body 'x\\ny\\x1b[2J'\n"), std::string::npos) << text;
}

}  // namespace
}  // namespace clearance
