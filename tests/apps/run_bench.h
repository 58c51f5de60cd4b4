// Runs the command `unseen-bench`, beside what run_command.h runs.
#pragma once

#include "run_command.h"

namespace unseen::app::testing {

class BenchTest : public CommandTest {
protected:
    Outcome bench(Words words) const {
        words.insert(words.begin(), UNSEEN_BENCH_COMMAND);
        return run_program(std::move(words));
    }

    // Every row has a value and, where it has both, what is better than the must.
    static void expect_measured(const Json& report, int least_with_targets) {
        int with_targets = 0;
        for (const Json& row : report["rows"]) {
            const std::string name = row["name"];
            with_targets += row["must"].is_number();
            EXPECT_TRUE(row["value"].is_number()) << name << ": " << row["note"];
            if (row["must"].is_number() && row["aim"].is_number() && row["value"].is_number()) {
                EXPECT_FALSE(row["holds_aim"].get<bool>() && !row["holds_must"].get<bool>()) << name;
            }
        }
        EXPECT_GE(with_targets, least_with_targets);
    }

    static Json row_named(const Json& report, const std::string& name) {
        for (const Json& one : report["rows"])
            if (one["name"] == name) return one;
        ADD_FAILURE() << "no row '" << name << "'";
        return {{"value", std::nan("")}};
    }
    static double value(const Json& report, const std::string& name) {
        return row_named(report, name)["value"].get<double>();
    }
};

} // namespace unseen::app::testing
