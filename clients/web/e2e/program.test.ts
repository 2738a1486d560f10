import { expect, it } from "vitest";
import { act, expectNoSeriousFault, opened, openSession } from "./browser";

const LONG_MS = 90_000;

it(
  "a program is set, asked what it would do, and tried live",
  async () => {
    const id = await openSession(`lua-${process.pid}`, 0, { task: "landing-2", kind: "human", worlds: 1 });
    await act(id, "start", {});
    await act(id, "attach_block_to", { base_block: "1", face: "E", new_block: "Flying Block" });
    const page = await opened(`/build?session=${id}`);
    // Beside other work a page that draws in software takes its time.
    page.setDefaultTimeout(LONG_MS);
    await page.getByRole("tab", { name: "Program" }).click();
    const text = page.getByLabel("Program, in Lua");
    await text.fill("function control(");
    await page.getByRole("button", { name: "Set the program" }).click();
    await page.getByText(/Not set: the controller failed, line 1/).waitFor();
    expect(await text.inputValue()).toBe("function control(");
    await text.fill("function control(t, sense)\n  return { fly = sense.position.z > 20 and 0.75 or 0 }\nend");
    await page.getByRole("button", { name: "Set the program" }).click();
    await page.locator("[data-result=accepted]").waitFor();
    await page.getByRole("button", { name: "What would it do?" }).click();
    await page.locator("[data-result=accepted]").waitFor();
    await page.getByText(/it senses position.z 5\d.* and does .*0.75/).waitFor();
    await expectNoSeriousFault(page);
    await page.getByRole("button", { name: "Practice trial" }).click();
    await page.locator("[data-outcome]").waitFor({ timeout: LONG_MS });
    // The session continues, and a reload finds the program.
    await page.reload();
    await page.getByRole("tab", { name: "Program" }).click();
    expect(await page.getByLabel("Program, in Lua").inputValue()).toContain("0.75");
    await page.close();
  },
  LONG_MS * 2,
);
