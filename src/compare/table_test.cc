#include "compare/table.h"

#include <gtest/gtest.h>

namespace tomofield::compare {
namespace {

Table small_table() {
  Table table;
  table.methods = {{"main", "Main", {}}, {"fast", "Fast", {}}, {"none", "None", {}}};
  table.add({"psnr", "PSNR", Column::Better::kHigher, 1}, {24.0, 22.0, std::nullopt});
  table.add({"seconds", "s", Column::Better::kLower, 0}, {30.0, 3.0, 40.0});
  table.add({"parameters", "M", Column::Better::kNeither, 2}, {1.0, std::nullopt, 0.5});
  return table;
}

TEST(ComparisonTable, KnowsWhatIsBetter) {
  const Table table = small_table();
  EXPECT_EQ(table.best_row(0), 0u);
  EXPECT_EQ(table.best_row(1), 1u);
  EXPECT_EQ(table.best_row(2), std::nullopt);
  EXPECT_FALSE(table.beats_first(1, 0));
  EXPECT_TRUE(table.beats_first(1, 1));
  EXPECT_FALSE(table.beats_first(2, 0)) << "a method without the figure";
  EXPECT_FALSE(table.beats_first(2, 1));
  EXPECT_FALSE(table.beats_first(2, 2)) << "fewer parameters are not better";
}

TEST(ComparisonTable, IsWrittenWithHolesWhereThereIsNoFigure) {
  const Table table = small_table();
  EXPECT_EQ(table_csv(table),
            "method,psnr,seconds,parameters\nmain,24,30,1\nfast,22,3,\nnone,,40,0.5\n");
  const auto cells = table_cells(table);
  EXPECT_EQ(cells[1][1].text, "24.0");
  EXPECT_EQ(cells[1][1].mark, "best");
  EXPECT_EQ(cells[2][2].mark, "best better");
  EXPECT_EQ(cells[3][1].text, "–");
}

}  // namespace
}  // namespace tomofield::compare
