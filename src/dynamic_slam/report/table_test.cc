#include "dynamic_slam/report/table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace dynamic_slam {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

Table Errors() {
  return {.title = "Errors",
          .note = "cm",
          .columns = {{.name = "sequence", .is_text = true},
                      {.name = "rmse", .group = "the paper's figures"},
                      {.name = "rmse", .group = "ours"},
                      {.name = "std", .group = "ours", .on_terminal = false}},
          .rows = {{"xyz", "1.3", "12.25", "0.1"}, {"a, b", "×", "–", "0.2"}}};
}

TEST(Table, TerminalAlignsColumnsUnderTheirHeadings) {
  EXPECT_EQ(TerminalText(Errors()),
            "Errors\n"
            "          the paper's figures  ours\n"
            "sequence                 rmse   rmse\n"
            "xyz                       1.3  12.25\n"
            "a, b                        ×      –\n"
            "cm\n");
}

TEST(Table, CsvHasAllColumnsAndQuotesCommas) {
  EXPECT_EQ(CsvText(Errors()),
            "sequence,the paper's figures: rmse,ours: rmse,ours: std\n"
            "xyz,1.3,12.25,0.1\n"
            "\"a, b\",×,–,0.2\n");
}

TEST(Table, JsonNamesCellsByTheirHeadings) {
  const nlohmann::ordered_json json = TableJson(Errors());
  EXPECT_EQ(json["rows"][0]["ours: rmse"], "12.25");
  EXPECT_EQ(json["rows"].size(), 2u);
}

TEST(Table, OfRowsTakesKeysAsColumnsAndShowsWhatIsMissing) {
  const Table table = TableOfRows("T", {{{"name", "a"}, {"x", 1.23456789}, {"n", 3}, {"ok", true}},
                                        {{"name", "b"}, {"x", nullptr}, {"n", 4}, {"ok", false}}});
  ASSERT_EQ(table.columns.size(), 4u);
  EXPECT_TRUE(table.columns[0].is_text);
  EXPECT_EQ(table.rows[0], (std::vector<std::string>{"a", "1.2346", "3", "yes"}));
  EXPECT_EQ(table.rows[1], (std::vector<std::string>{"b", "-", "4", "no"}));
}

}  // namespace
}  // namespace dynamic_slam
