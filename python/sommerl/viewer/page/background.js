/** The page's worker, which is asked by messages. */
export class Background {
    constructor() {
        const text = document.getElementById("worker").textContent;
        this.worker = new Worker(URL.createObjectURL(new Blob([text], { type: "text/javascript" })));
        this.answers = new Map(); // what waits for them, by number of the question
        this.asked = 0;
        this.worker.onerror = () => {
            for (const answer of this.answers.values()) answer({ error: "the page's worker has stopped: reload the page" });
            this.answers.clear();
        };
        this.worker.onmessage = ({ data: { id, ...answer } }) => {
            this.answers.get(id)(answer);
            this.answers.delete(id);
        };
    }

    /** The answer to a question as worker.js says. Throws an Error that says what went wrong. */
    async ask(question, transfer = []) {
        const id = this.asked++;
        const answer = await new Promise((resolve) => {
            this.answers.set(id, resolve);
            this.worker.postMessage({ id, ...question }, transfer);
        });
        if (answer.error) throw new Error(answer.error);
        return answer;
    }
}
