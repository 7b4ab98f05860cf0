// What a verification found, as people understand it: what was compared, how sure it is, and what it does not say.
import { Verdict } from "./vendor/api.js";
import { element, moment } from "./elements.js";

const HEADS = {
    [Verdict.MATCH]: ["match", "The mark is there"],
    [Verdict.NO_MATCH]: ["no-match", "The mark was not found"],
    [Verdict.INCONCLUSIVE]: ["unsure", "Nothing can be said"],
    [Verdict.UNKNOWN_KEY]: ["unsure", "Nothing is registered to compare with"],
};

/** A probability in words: how often among so many tests. */
export function often(probability) {
    if (!(probability > 0)) return "never, as far as can be told,";
    if (probability >= 0.1) return `in ${Math.round(100 * Math.min(probability, 1))} of 100 tests`;
    const many = 1 / probability;
    if (many < 1e6) return `once in ${Math.round(many).toLocaleString("en")} tests`;
    const words = [[1e18, "billion billion"], [1e15, "million billion"], [1e12, "thousand billion"], [1e9, "billion"], [1e6, "million"]];
    const [unit, word] = words.find(([least]) => many >= least);
    return `once in ${Number((many / unit).toPrecision(2)).toLocaleString("en")} ${word} tests`;
}

function sure(result) {
    const { verdict, pValue, threshold, matchedBits, rankSum, neededRankSum, bits } = result;
    const lines = [];
    if (matchedBits !== undefined) {
        lines.push(`${matchedBits} of ${bits} bits agree.`);
    }
    if (rankSum !== undefined) {
        const share = (sum) => `${((200 * sum) / (bits * (bits + 1))).toFixed(1)} %`;
        const needed = neededRankSum === undefined ? "" : `; ${share(neededRankSum)} are needed`;
        lines.push(`Weighed by how clearly each was read, ${share(rankSum)} agree${needed}.`);
    }
    if (verdict === Verdict.MATCH && pValue !== undefined) {
        const most = result.redacted ? "at most " : "";
        lines.push(`Without the mark, chance would agree as well ${most}${often(pValue)}.`);
    }
    if (verdict === Verdict.NO_MATCH && pValue !== undefined) {
        lines.push(`Chance alone agrees as well ${often(pValue)}.`);
    }
    if (threshold !== undefined) {
        lines.push(`This server says that a mark is there only where chance would say so at most ${often(threshold)}.`);
    }
    if (result.redacted) lines.push("How near it was is told to admins of the project only.");
    return lines;
}

function limits(result) {
    if (result.verdict === Verdict.MATCH) {
        return [
            "Not who put the mark there: whoever may use the key can.",
            "Not who may use the scene. A mark is evidence of where something came from, not a right to it.",
            "Not that a picture is unchanged: marks are read through many changes.",
        ];
    }
    if (result.verdict === Verdict.NO_MATCH) {
        return [
            "Not that the mark was never there: strong compression, grey pictures, turned hues, or scenes that fill less than a third of a picture hide it.",
            "Nothing about other keys, messages or originals than those that were compared.",
        ];
    }
    return ["Neither that the mark is there, nor that it is not."];
}

function compared(result, asked) {
    const rows = [
        ["Suspect", asked.files],
        ["Key", asked.key],
        ["Claim", asked.claim],
        ["Read", `${result.views} ${result.views === 1 ? "picture or view" : "pictures or views"}, in ${result.framings || 1} ${result.framings > 1 ? "ways" : "way"}`],
    ];
    if (result.framing) rows.push(["Way that agreed best", result.framing]);
    if (result.assets > 0n) rows.push(["Originals compared", `${result.assets}`]);
    if (result.hypotheses !== undefined) rows.push(["Hypotheses paid for", `${result.hypotheses}`]);
    if (asked.found) rows.push(["Original found", asked.found]);
    if (result.assetCommitTime) rows.push(["Registered", moment(result.assetCommitTime)]);
    if (result.firstSeenTime) rows.push(["Suspect first seen", moment(result.firstSeenTime)]);
    if (result.ignoredRows > 0n) rows.push(["Rows that were ignored", `${result.ignoredRows}`]);
    return rows;
}

const list = (texts) => element("ul", {}, ...texts.map((text) => element("li", {}, text)));

/** Rows of a name and a value. */
export const table = (rows) =>
    element("dl", {}, ...rows.flatMap(([name, value]) => [element("dt", {}, name), element("dd", {}, value)]));

/** A verdict. `asked` says what was asked, in words: `files`, `key`, `claim`, and perhaps `found`. */
export function verdict(result, asked) {
    const [kind, head] = HEADS[result.verdict] ?? HEADS[Verdict.INCONCLUSIVE];
    const box = element("div", { className: `verdict ${kind}` }, element("h2", { tabIndex: -1 }, head));
    if (result.reason) box.append(element("p", {}, result.reason));
    if (result.assetRegisteredLater) {
        box.append(element("p", {}, "The original was registered after the suspect was first seen here, so it can't carry its mark."));
    }
    return [
        box,
        element("h3", {}, "How sure"),
        list(sure(result)),
        element("h3", {}, "What was compared"),
        table(compared(result, asked)),
        element("h3", {}, "What it does not say"),
        list(limits(result)),
    ];
}
