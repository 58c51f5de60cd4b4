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

    // Every row has a value.
    static void expect_measured(const Json& report, int least_with_targets) {
        int with_targets = 0;
        for (const Json& row : report["rows"]) {
            with_targets += row["target"].is_number();
            EXPECT_TRUE(row["value"].is_number()) << row["name"] << ": " << row["note"];
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
